{# Four and eight doubles at a time: vectors of the processor where there are some, else a plain struct. #}
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
GREYBED_HOT double smaller(double x, double y) { return x < y ? x : y; }
GREYBED_HOT double total(double v) { return v; }
/// The whole number k next to y, |y| < 1022, and 2^k. No step relies on the order of rounding.
GREYBED_HOT void rounded(double y, double& k, double& power) {
  const std::int64_t whole = static_cast<std::int64_t>(y + (y < 0.0 ? -0.5 : 0.5));
  const std::uint64_t bits = static_cast<std::uint64_t>(whole + 1023) << 52;
  std::memcpy(&power, &bits, sizeof power);
  k = static_cast<double>(whole);
}
/// x = 2^k z with sqrt(1/2) <= z < sqrt(2), for positive x that is not tiny.
GREYBED_HOT void parted(double x, double& k, double& z) {
  std::uint64_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  const std::uint64_t e = (bits - 0x3fe6a09e667f3bcdULL + (1023ULL << 52)) >> 52;
  bits -= (e - 1023) << 52;
  std::memcpy(&z, &bits, sizeof z);
  k = static_cast<double>(static_cast<std::int64_t>(e) - 1023);
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
GREYBED_HOT d2 smaller(const d2& x, const d2& y) { return _mm_min_pd(x, y); }
/// A number that the compiler knows nothing of from here on.
GREYBED_HOT void hide(d2& v) { __asm__("" : "+x"(v)); }
GREYBED_HOT double total(const d2& v) { return v[0] + v[1]; }
/// An exponent in the last bits of a number, as a power of two.
GREYBED_HOT d2 power_of(const d2& bits) {
  return _mm_castsi128_pd(_mm_slli_epi64(_mm_castpd_si128(bits), 52));
}
GREYBED_HOT void rounded(const d2& y, d2& k, d2& power) {
  const d2 magic = _mm_set1_pd(6755399441056767.0);  // 1.5 * 2^52 + 1023: adding it rounds
  d2 bits = y + magic;
  hide(bits);  // -ffast-math would put what is added and what is taken off together,
  k = bits - magic;
  hide(k);  // ... or share out a product
  power = power_of(bits);
}
GREYBED_HOT void parted(const d2& x, d2& k, d2& z) {
  const __m128i bits = _mm_castpd_si128(x);
  const __m128i moved = _mm_add_epi64(
      bits, _mm_set1_epi64x((1023LL << 52) - 0x3fe6a09e667f3bcdLL));
  const __m128i e = _mm_srli_epi64(moved, 52);
  z = _mm_castsi128_pd(
      _mm_sub_epi64(bits, _mm_slli_epi64(_mm_sub_epi64(e, _mm_set1_epi64x(1023)), 52)));
  // 2^52 + e, by its bits
  k = _mm_castsi128_pd(_mm_or_si128(e, _mm_set1_epi64x(0x4330000000000000LL)));
  hide(k);
  k = k - _mm_set1_pd(4503599627371519.0);
  hide(k);
}
#endif

#if defined(GREYBED_VECTORS) && (defined(__AVX__) || defined(GREYBED_AVX2))
#define GREYBED_WIDE 1
typedef double d4 __attribute__((__vector_size__(32)));
GREYBED_HOT void load(const double* p, d4& v) { v = _mm256_loadu_pd(p); }
GREYBED_HOT void store(const d4& v, double* p) { _mm256_storeu_pd(p, v); }
GREYBED_HOT void spread(double x, d4& v) { v = _mm256_set1_pd(x); }
GREYBED_HOT void add_product(d4& sum, const d4& x, const d4& y) { sum += x * y; }
GREYBED_HOT d4 root(const d4& x) { return _mm256_sqrt_pd(x); }
GREYBED_HOT d4 larger(const d4& x, const d4& y) { return _mm256_max_pd(x, y); }
GREYBED_HOT d4 smaller(const d4& x, const d4& y) { return _mm256_min_pd(x, y); }
GREYBED_HOT void hide(d4& v) { __asm__("" : "+x"(v)); }
GREYBED_HOT double total(const d4& v) { return (v[0] + v[1]) + (v[2] + v[3]); }
GREYBED_HOT d4 power_of(const d4& bits) {
#if defined(__AVX2__) || defined(GREYBED_AVX2)
  return _mm256_castsi256_pd(_mm256_slli_epi64(_mm256_castpd_si256(bits), 52));
#else
  const d2 low = power_of(_mm256_castpd256_pd128(bits));
  const d2 high = power_of(_mm256_extractf128_pd(bits, 1));
  return _mm256_insertf128_pd(_mm256_castpd128_pd256(low), high, 1);
#endif
}
GREYBED_HOT void rounded(const d4& y, d4& k, d4& power) {
  const d4 magic = _mm256_set1_pd(6755399441056767.0);
  d4 bits = y + magic;
  hide(bits);
  k = bits - magic;
  hide(k);
  power = power_of(bits);
}
GREYBED_HOT void parted(const d4& x, d4& k, d4& z) {
#if defined(__AVX2__) || defined(GREYBED_AVX2)
  const __m256i bits = _mm256_castpd_si256(x);
  const __m256i e = _mm256_srli_epi64(
      _mm256_add_epi64(bits, _mm256_set1_epi64x((1023LL << 52) - 0x3fe6a09e667f3bcdLL)), 52);
  z = _mm256_castsi256_pd(_mm256_sub_epi64(
      bits, _mm256_slli_epi64(_mm256_sub_epi64(e, _mm256_set1_epi64x(1023)), 52)));
  k = _mm256_castsi256_pd(_mm256_or_si256(e, _mm256_set1_epi64x(0x4330000000000000LL)));
  hide(k);
  k = k - _mm256_set1_pd(4503599627371519.0);
  hide(k);
#else
  d2 low = _mm256_castpd256_pd128(x);
  d2 high = _mm256_extractf128_pd(x, 1);
  d2 k_low;
  d2 k_high;
  parted(low, k_low, low);
  parted(high, k_high, high);
  k = _mm256_insertf128_pd(_mm256_castpd128_pd256(k_low), k_high, 1);
  z = _mm256_insertf128_pd(_mm256_castpd128_pd256(low), high, 1);
#endif
}
#endif

// Eight at a time. With GREYBED_EIGHT also where the processor has only four, which tests this code.
#if defined(GREYBED_WIDE) && (defined(__AVX512F__) || defined(GREYBED_AVX512) || defined(GREYBED_EIGHT))
#define GREYBED_WIDEST 1
typedef double d8 __attribute__((__vector_size__(64)));
typedef long long i8 __attribute__((__vector_size__(64)));
GREYBED_HOT void load(const double* p, d8& v) { std::memcpy(&v, p, sizeof v); }
GREYBED_HOT void store(const d8& v, double* p) { std::memcpy(p, &v, sizeof v); }
GREYBED_HOT void spread(double x, d8& v) {
  const d8 all = {x, x, x, x, x, x, x, x};
  v = all;
}
GREYBED_HOT void add_product(d8& sum, const d8& x, const d8& y) { sum += x * y; }
GREYBED_HOT d4 half(const d8& v) {
  d4 low;
  std::memcpy(&low, &v, sizeof low);
  return low;
}
GREYBED_HOT double total(const d8& v) {
  return ((v[0] + v[4]) + (v[1] + v[5])) + ((v[2] + v[6]) + (v[3] + v[7]));
}
#if defined(__AVX512F__) || defined(GREYBED_AVX512)
GREYBED_HOT void root_of(const d8& x, d8& r) { r = _mm512_sqrt_pd(x); }
GREYBED_HOT void hide(d8& v) { __asm__("" : "+v"(v)); }
#else
GREYBED_HOT void root_of(const d8& x, d8& r) {
  d4 part[2];
  std::memcpy(part, &x, sizeof x);
  part[0] = root(part[0]);
  part[1] = root(part[1]);
  std::memcpy(&r, part, sizeof r);
}
GREYBED_HOT void hide(d8& v) { __asm__("" : "+m"(v)); }
#endif
GREYBED_HOT d8 root(const d8& x) {
  d8 r;
  root_of(x, r);
  return r;
}
GREYBED_HOT void rounded(const d8& y, d8& k, d8& power) {
  d8 magic;
  spread(6755399441056767.0, magic);
  d8 bits = y + magic;
  hide(bits);
  k = bits - magic;
  hide(k);
  i8 whole;
  std::memcpy(&whole, &bits, sizeof whole);
  whole <<= 52;
  std::memcpy(&power, &whole, sizeof power);
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
GREYBED_HOT Two<L> smaller(const Two<L>& x, const Two<L>& y) {
  const Two<L> r = {smaller(x.a, y.a), smaller(x.b, y.b)};
  return r;
}
template <class L>
GREYBED_HOT double total(const Two<L>& v) {
  return total(v.a) + total(v.b);
}
template <class L>
GREYBED_HOT void rounded(const Two<L>& y, Two<L>& k, Two<L>& power) {
  rounded(y.a, k.a, power.a);
  rounded(y.b, k.b, power.b);
}
template <class L>
GREYBED_HOT void parted(const Two<L>& x, Two<L>& k, Two<L>& z) {
  parted(x.a, k.a, z.a);
  parted(x.b, k.b, z.b);
}

#if defined(GREYBED_WIDE)
typedef d4 v4;
#elif defined(GREYBED_VECTORS)
typedef Two<d2> v4;
#else
typedef Two<Two<double> > v4;
#endif

#if defined(GREYBED_WIDE)
GREYBED_HOT v4 four(double a, double b, double c, double d) { return _mm256_set_pd(d, c, b, a); }
#elif defined(GREYBED_VECTORS)
GREYBED_HOT v4 four(double a, double b, double c, double d) {
  const v4 v = {_mm_set_pd(b, a), _mm_set_pd(d, c)};
  return v;
}
#else
GREYBED_HOT v4 four(double a, double b, double c, double d) {
  v4 v;
  v.a.a = a;
  v.a.b = b;
  v.b.a = c;
  v.b.b = d;
  return v;
}
#endif
GREYBED_HOT v4 four(double x) {
  v4 v;
  spread(x, v);
  return v;
}

#if defined(GREYBED_WIDEST)
typedef d8 v8;
#else
typedef Two<v4> v8;
GREYBED_HOT v4 half(const v8& v) { return v.a; }
#endif
GREYBED_HOT v8 eight(double x) {
  v8 v;
  spread(x, v);
  return v;
}
