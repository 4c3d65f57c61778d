{# Four doubles at a time: the compiler's vectors where there are some, else a plain struct. #}
#if defined(__AVX__) && (defined(__clang__) || defined(__GNUC__))
typedef double v4 __attribute__((vector_size(32)));

inline void load(const double* p, v4& v) { std::memcpy(&v, p, sizeof v); }
inline void store(const v4& v, double* p) { std::memcpy(p, &v, sizeof v); }
inline void add_scaled(v4& sum, const v4& w, double x) { sum += w * x; }
inline void add_product(v4& sum, const v4& w, const v4& x) { sum += w * x; }
inline void scale_by(v4& v, const v4& w) { v *= w; }
inline double total(const v4& v) { return (v[0] + v[1]) + (v[2] + v[3]); }

/// x / sqrt(1 + x^2), and the slope of it.
inline void squash(v4& x, v4& slope) {
  const v4 square = 1.0 + x * x;
  const v4 inverse = 1.0 / (v4)_mm256_sqrt_pd((__m256d)square);
  x *= inverse;
  slope = inverse * inverse * inverse;
}
#else
struct v4 {
  double v[4];
};

inline void load(const double* p, v4& v) { std::memcpy(v.v, p, sizeof v.v); }
inline void store(const v4& v, double* p) { std::memcpy(p, v.v, sizeof v.v); }
inline void add_scaled(v4& sum, const v4& w, double x) {
  for (int i = 0; i < 4; ++i) sum.v[i] += w.v[i] * x;
}
inline void add_product(v4& sum, const v4& w, const v4& x) {
  for (int i = 0; i < 4; ++i) sum.v[i] += w.v[i] * x.v[i];
}
inline void scale_by(v4& v, const v4& w) {
  for (int i = 0; i < 4; ++i) v.v[i] *= w.v[i];
}
inline double total(const v4& v) { return (v.v[0] + v.v[1]) + (v.v[2] + v.v[3]); }
inline void squash(v4& x, v4& slope) {
  for (int i = 0; i < 4; ++i) {
    const double inverse = 1.0 / std::sqrt(1.0 + x.v[i] * x.v[i]);
    x.v[i] *= inverse;
    slope.v[i] = inverse * inverse * inverse;
  }
}
#endif

