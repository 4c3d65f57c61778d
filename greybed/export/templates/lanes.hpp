{# Four doubles at a time: vectors of the processor where there are some, else a plain struct. #}
/// Two of a kind, for processors with shorter vectors than four doubles, or none.
template <class L>
struct Two {
  L a;
  L b;
};

template <class L>
GREYBED_HOT Two<L> operator+(const Two<L>& x, const Two<L>& y) {
  const Two<L> r = {x.a + y.a, x.b + y.b};
  return r;
}
template <class L>
GREYBED_HOT Two<L> operator-(const Two<L>& x, const Two<L>& y) {
  const Two<L> r = {x.a - y.a, x.b - y.b};
  return r;
}
template <class L>
GREYBED_HOT Two<L> operator*(const Two<L>& x, const Two<L>& y) {
  const Two<L> r = {x.a * y.a, x.b * y.b};
  return r;
}
template <class L>
GREYBED_HOT Two<L> operator/(const Two<L>& x, const Two<L>& y) {
  const Two<L> r = {x.a / y.a, x.b / y.b};
  return r;
}

GREYBED_HOT void load(const double* p, double& v) { v = *p; }
GREYBED_HOT void store(double v, double* p) { *p = v; }
GREYBED_HOT void spread(double x, double& v) { v = x; }
GREYBED_HOT void add_product(double& sum, double x, double y) { sum += x * y; }
GREYBED_HOT double root(double x) { return std::sqrt(x); }
GREYBED_HOT double larger(double x, double y) { return x < y ? y : x; }
GREYBED_HOT double magnitude(double x) { return std::fabs(x); }
GREYBED_HOT double signed_as(double x, double sign) { return sign < 0.0 ? -x : x; }
GREYBED_HOT double total(double v) { return v; }
/// x = log(2) k + r with |r| <= log(2) / 2, for x <= 0; power = 2^k.
GREYBED_HOT void reduced(double x, double& r, double& power) {
  // The cast cuts towards zero, which rounds as x <= 0; it needs no order of rounding.
  const int k = static_cast<int>(x * 1.4426950408889634 - 0.5);
  r = (x - k * 0.693147180369123816490) - k * 1.90821492927058770002e-10;
  const std::uint64_t bits = static_cast<std::uint64_t>(k + 1023) << 52;
  std::memcpy(&power, &bits, sizeof power);
}

#if defined(__SSE2__) && (defined(__clang__) || defined(__GNUC__)) && !defined(__CUDA__) && \
    !defined(__CUDACC__) && !defined(__HIPCC__)
#define GREYBED_VECTORS 1
typedef double d2 __attribute__((__vector_size__(16)));
GREYBED_HOT void load(const double* p, d2& v) { v = _mm_loadu_pd(p); }
GREYBED_HOT void store(const d2& v, double* p) { _mm_storeu_pd(p, v); }
GREYBED_HOT void spread(double x, d2& v) { v = _mm_set1_pd(x); }
GREYBED_HOT void add_product(d2& sum, const d2& x, const d2& y) { sum += x * y; }
GREYBED_HOT d2 root(const d2& x) { return _mm_sqrt_pd(x); }
GREYBED_HOT d2 larger(const d2& x, const d2& y) { return _mm_max_pd(x, y); }
GREYBED_HOT d2 magnitude(const d2& x) {
  return _mm_and_pd(x, _mm_castsi128_pd(_mm_set1_epi64x(0x7fffffffffffffffLL)));
}
GREYBED_HOT d2 signed_as(const d2& x, const d2& sign) {
  const d2 mask = _mm_castsi128_pd(_mm_set1_epi64x(0x7fffffffffffffffLL));
  return _mm_or_pd(x, _mm_andnot_pd(mask, sign));
}
/// A number that the compiler knows nothing of from here on.
GREYBED_HOT void hide(d2& v) { __asm__("" : "+x"(v)); }
GREYBED_HOT double total(const d2& v) { return v[0] + v[1]; }
GREYBED_HOT void reduced(const d2& x, d2& r, d2& power) {
  const d2 magic = _mm_set1_pd(6755399441055744.0);  // 1.5 * 2^52: adding it rounds
  d2 t = x * _mm_set1_pd(1.4426950408889634) + magic;
  hide(t);  // -ffast-math would put what was added and what is taken off together,
  d2 k = t - magic;
  hide(k);  // ... or share out the product
  r = (x - k * _mm_set1_pd(0.693147180369123816490)) - k * _mm_set1_pd(1.90821492927058770002e-10);
  power = _mm_castsi128_pd(
      _mm_slli_epi64(_mm_add_epi64(_mm_castpd_si128(t), _mm_set1_epi64x(1023)), 52));
}
#endif

template <class L>
GREYBED_HOT void load(const double* p, Two<L>& v) {
  load(p, v.a);
  load(p + sizeof(L) / sizeof(double), v.b);
}
template <class L>
GREYBED_HOT void store(const Two<L>& v, double* p) {
  store(v.a, p);
  store(v.b, p + sizeof(L) / sizeof(double));
}
template <class L>
GREYBED_HOT void spread(double x, Two<L>& v) {
  spread(x, v.a);
  spread(x, v.b);
}
template <class L>
GREYBED_HOT void add_product(Two<L>& sum, const Two<L>& x, const Two<L>& y) {
  add_product(sum.a, x.a, y.a);
  add_product(sum.b, x.b, y.b);
}
template <class L>
GREYBED_HOT Two<L> root(const Two<L>& x) {
  const Two<L> r = {root(x.a), root(x.b)};
  return r;
}
template <class L>
GREYBED_HOT Two<L> larger(const Two<L>& x, const Two<L>& y) {
  const Two<L> r = {larger(x.a, y.a), larger(x.b, y.b)};
  return r;
}
template <class L>
GREYBED_HOT Two<L> magnitude(const Two<L>& x) {
  const Two<L> r = {magnitude(x.a), magnitude(x.b)};
  return r;
}
template <class L>
GREYBED_HOT Two<L> signed_as(const Two<L>& x, const Two<L>& sign) {
  const Two<L> r = {signed_as(x.a, sign.a), signed_as(x.b, sign.b)};
  return r;
}
template <class L>
GREYBED_HOT double total(const Two<L>& v) {
  return total(v.a) + total(v.b);
}
template <class L>
GREYBED_HOT void reduced(const Two<L>& x, Two<L>& r, Two<L>& power) {
  reduced(x.a, r.a, power.a);
  reduced(x.b, r.b, power.b);
}

#if defined(GREYBED_VECTORS) && (defined(__AVX__) || defined(GREYBED_AVX2))
typedef __m256d v4;
GREYBED_HOT void load(const double* p, v4& v) { v = _mm256_loadu_pd(p); }
GREYBED_HOT void store(const v4& v, double* p) { _mm256_storeu_pd(p, v); }
GREYBED_HOT void spread(double x, v4& v) { v = _mm256_set1_pd(x); }
GREYBED_HOT void add_product(v4& sum, const v4& x, const v4& y) { sum += x * y; }
GREYBED_HOT v4 root(const v4& x) { return _mm256_sqrt_pd(x); }
GREYBED_HOT v4 larger(const v4& x, const v4& y) { return _mm256_max_pd(x, y); }
GREYBED_HOT v4 magnitude(const v4& x) {
  return _mm256_and_pd(x, _mm256_castsi256_pd(_mm256_set1_epi64x(0x7fffffffffffffffLL)));
}
GREYBED_HOT v4 signed_as(const v4& x, const v4& sign) {
  const v4 mask = _mm256_castsi256_pd(_mm256_set1_epi64x(0x7fffffffffffffffLL));
  return _mm256_or_pd(x, _mm256_andnot_pd(mask, sign));
}
GREYBED_HOT void hide(v4& v) { __asm__("" : "+x"(v)); }
GREYBED_HOT double total(const v4& v) { return (v[0] + v[1]) + (v[2] + v[3]); }
GREYBED_HOT void reduced(const v4& x, v4& r, v4& power) {
  const v4 magic = _mm256_set1_pd(6755399441055744.0);
  v4 t = x * _mm256_set1_pd(1.4426950408889634) + magic;
  hide(t);
  v4 k = t - magic;
  hide(k);
  r = (x - k * _mm256_set1_pd(0.693147180369123816490)) -
      k * _mm256_set1_pd(1.90821492927058770002e-10);
#if defined(__AVX2__) || defined(GREYBED_AVX2)
  power = _mm256_castsi256_pd(_mm256_slli_epi64(
      _mm256_add_epi64(_mm256_castpd_si256(t), _mm256_set1_epi64x(1023)), 52));
#else
  const __m128i bias = _mm_set1_epi64x(1023);
  const __m128i low = _mm_castpd_si128(_mm256_castpd256_pd128(t));
  const __m128i high = _mm_castpd_si128(_mm256_extractf128_pd(t, 1));
  power = _mm256_insertf128_pd(
      _mm256_castpd128_pd256(_mm_castsi128_pd(_mm_slli_epi64(_mm_add_epi64(low, bias), 52))),
      _mm_castsi128_pd(_mm_slli_epi64(_mm_add_epi64(high, bias), 52)), 1);
#endif
}
#elif defined(GREYBED_VECTORS)
typedef Two<d2> v4;
#else
typedef Two<Two<double> > v4;
#endif

GREYBED_HOT v4 four(double x) {
  v4 v;
  spread(x, v);
  return v;
}

/// e^x to a few 1e-16, for -700 <= x <= 0.
GREYBED_HOT v4 exp_below(const v4& x) {
  v4 r;
  v4 power;
  reduced(x, r, power);
  v4 e = four(1.0 / 6227020800.0);
{% for factor in ["479001600", "39916800", "3628800", "362880", "40320", "5040", "720", "120", "24", "6"] %}
  e = e * r + four(1.0 / {{ factor }}.0);
{% endfor %}
  e = e * r + four(0.5);
  e = e * r + four(1.0);
  e = e * r + four(1.0);
  return e * power;
}

/// Layers with tanh.
struct Tanh {
  static GREYBED_HOT void squash(v4& x, v4& slope) {
    // tanh(20) rounds to 1
    const v4 e = exp_below(larger(four(-2.0) * magnitude(x), four(-40.0)));
    const v4 y = (four(1.0) - e) / (four(1.0) + e);
    slope = four(1.0) - y * y;
    x = signed_as(y, x);
  }
};

/// Layers with x / sqrt(1 + x^2).
struct Bent {
  static GREYBED_HOT void squash(v4& x, v4& slope) {
    const v4 inverse = four(1.0) / root(four(1.0) + x * x);
    x = x * inverse;
    slope = inverse * inverse * inverse;
  }
};
