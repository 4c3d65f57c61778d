{# Numbers that carry their derivatives: formulae written once give both. #}
/// A number and its derivatives, 4 B of them.
template <int B>
struct Dual {
  double v;
  Sums<B> d;

  Dual() = default;
  GREYBED_HOT explicit Dual(double value) : v(value) { d.set(0.0); }
  /// f(x) with its slope.
  GREYBED_HOT Dual(double value, double slope, const Dual& x) : v(value) {
    d.scaled(x.d, eight(slope));
  }
  GREYBED_HOT Dual(double value, double s, const Dual& x, double t, const Dual& y) : v(value) {
    d.mix(x.d, eight(s), y.d, eight(t));
  }
};

template <int B>
GREYBED_HOT Dual<B> operator+(const Dual<B>& x, const Dual<B>& y) {
  return Dual<B>(x.v + y.v, 1.0, x, 1.0, y);
}
template <int B>
GREYBED_HOT Dual<B> operator+(double x, const Dual<B>& y) {
  return Dual<B>(x + y.v, 1.0, y);
}
template <int B>
GREYBED_HOT Dual<B> operator+(const Dual<B>& x, double y) {
  return Dual<B>(x.v + y, 1.0, x);
}
template <int B>
GREYBED_HOT Dual<B> operator-(const Dual<B>& x, const Dual<B>& y) {
  return Dual<B>(x.v - y.v, 1.0, x, -1.0, y);
}
template <int B>
GREYBED_HOT Dual<B> operator-(double x, const Dual<B>& y) {
  return Dual<B>(x - y.v, -1.0, y);
}
template <int B>
GREYBED_HOT Dual<B> operator-(const Dual<B>& x) {
  return Dual<B>(-x.v, -1.0, x);
}
template <int B>
GREYBED_HOT Dual<B> operator*(const Dual<B>& x, const Dual<B>& y) {
  return Dual<B>(x.v * y.v, y.v, x, x.v, y);
}
template <int B>
GREYBED_HOT Dual<B> operator*(double x, const Dual<B>& y) {
  return Dual<B>(x * y.v, x, y);
}
template <int B>
GREYBED_HOT Dual<B> operator/(const Dual<B>& x, const Dual<B>& y) {
  const double q = x.v / y.v;
  return Dual<B>(q, 1.0 / y.v, x, -q / y.v, y);
}
template <int B>
GREYBED_HOT Dual<B> operator/(const Dual<B>& x, double y) {
  return Dual<B>(x.v / y, 1.0 / y, x);
}
template <int B>
GREYBED_HOT Dual<B> operator/(double x, const Dual<B>& y) {
  const double q = x / y.v;
  return Dual<B>(q, -q / y.v, y);
}
template <int B>
GREYBED_HOT bool operator>(const Dual<B>& x, double y) {
  return x.v > y;
}

GREYBED_HOT double exp_of(double x) { return std::exp(x); }
GREYBED_HOT double expm1_of(double x) { return std::expm1(x); }
GREYBED_HOT double log_of(double x) { return std::log(x); }
GREYBED_HOT double log1p_of(double x) { return std::log1p(x); }
GREYBED_HOT double pow_of(double x, double power) { return std::pow(x, power); }
/// 1 - x for x <= 1. By a choice, so that -ffast-math cannot put it together with what follows.
GREYBED_HOT double rest_of(double x) { return x < 1.0 ? 1.0 - x : 0.0; }
/// tanh of one number, as the layers have it.
GREYBED_DEVICE inline double tanh_of(double x) {
  v4 y = four(x < -20.0 ? -20.0 : (x > 20.0 ? 20.0 : x));
  v4 slope;
  squash<Tanh>(y, slope);
  double all[4];
  store(y, all);
  return all[0];
}
template <int B>
GREYBED_HOT Dual<B> exp_of(const Dual<B>& x) {
  const double e = std::exp(x.v);
  return Dual<B>(e, e, x);
}
template <int B>
GREYBED_HOT Dual<B> expm1_of(const Dual<B>& x) {
  return Dual<B>(std::expm1(x.v), std::exp(x.v), x);
}
template <int B>
GREYBED_HOT Dual<B> log_of(const Dual<B>& x) {
  return Dual<B>(std::log(x.v), 1.0 / x.v, x);
}
template <int B>
GREYBED_HOT Dual<B> log1p_of(const Dual<B>& x) {
  return Dual<B>(std::log1p(x.v), 1.0 / (1.0 + x.v), x);
}
/// x^p; at x = 0 with a slope of 0.
template <int B>
GREYBED_HOT Dual<B> pow_of(const Dual<B>& x, double power) {
  const double value = std::pow(x.v, power);
  return Dual<B>(value, x.v > 0.0 ? power * value / x.v : 0.0, x);
}
template <int B>
GREYBED_HOT Dual<B> rest_of(const Dual<B>& x) {
  return Dual<B>(rest_of(x.v), -1.0, x);
}
template <int B>
GREYBED_HOT Dual<B> tanh_of(const Dual<B>& x) {
  const double t = tanh_of(x.v);
  return Dual<B>(t, 1.0 - t * t, x);
}
GREYBED_HOT double value_of(double x) { return x; }
template <int B>
GREYBED_HOT double value_of(const Dual<B>& x) {
  return x.v;
}
