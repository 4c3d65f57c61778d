{# Exponential, logarithm and the bends of layers, for any number of lanes. #}
template <class L>
GREYBED_HOT L constant(double x) {
  L v;
  spread(x, v);
  return v;
}

/// e^x to a few 1e-16, for -700 <= x <= 700.
template <class L>
GREYBED_HOT L exp_lanes(const L& x) {
  L k;
  L power;
  rounded(x * constant<L>(1.4426950408889634), k, power);
  const L r = (x - k * constant<L>(0.693147180369123816490)) -
              k * constant<L>(1.90821492927058770002e-10);
  // (e^r - 1 - r) / r^2 by its values at Chebyshev's nodes: 1.6e-17 of e^r
  // In pairs, whose sums do not wait for each other.
  const L r2 = r * r;
  const L r4 = r2 * r2;
  const L q_0 = constant<L>(0.5000000000000001) + constant<L>(0.16666666666666669) * r;
  const L q_1 = constant<L>(0.04166666666662413) + constant<L>(0.008333333333330062) * r;
  const L q_2 = constant<L>(0.0013888888917213717) + constant<L>(0.00019841269863053618) * r;
  const L q_3 = constant<L>(2.4801521295954376e-05) + constant<L>(2.7557268459997064e-06) * r;
  const L q_4 = constant<L>(2.7620088445409746e-07) + constant<L>(2.510038549551032e-08) * r;
  const L low = q_0 + q_1 * r2;
  const L high = (q_2 + q_3 * r2) + q_4 * r4;
  return (constant<L>(1.0) + (r + r2 * (low + high * r4))) * power;
}

/// log(x) to a few 1e-16 of it, and of 1 near 1, for positive x (constants of fdlibm, Sun 1993).
template <class L>
GREYBED_HOT L log_lanes(const L& x) {
  L k;
  L z;
  parted(x, k, z);
  const L f = z - constant<L>(1.0);
  const L s = f / (constant<L>(2.0) + f);
  const L w = s * s;
  const L w2 = w * w;
  // Odd and even powers, as fdlibm has them.
  const L odd = constant<L>(3.999999999940941908e-01) + w2 * (constant<L>(2.222219843214978396e-01) +
                w2 * constant<L>(1.531383769920937332e-01));
  const L even = constant<L>(6.666666666666735130e-01) + w2 * (constant<L>(2.857142874366239149e-01) +
                 w2 * (constant<L>(1.818357216161805012e-01) +
                       w2 * constant<L>(1.479819860511658591e-01)));
  const L half = constant<L>(0.5) * (f * f);
  const L low = s * (half + (w * even + w2 * odd)) + k * constant<L>(1.90821492927058770002e-10);
  return k * constant<L>(0.693147180369123816490) - ((half - low) - f);
}

/// Layers with tanh.
struct Tanh {
  template <class L>
  static GREYBED_HOT void squash(L& x, L& slope) {
    // e^(-2 x) = 2^y: what rounding y costs is lost where it could be seen. tanh(20) rounds to 1.
    const L y = larger(smaller(x, constant<L>(20.0)), constant<L>(-20.0)) *
                constant<L>(-2.8853900817779268);
    L k;
    L power;
    rounded(y, k, power);
    const L f = y - k;
    const L f2 = f * f;
    // (2^f - 1) / f by its values at Chebyshev's nodes, even and odd: 2e-17 of 2^f
    L even = constant<L>(4.4549643712692967e-10);
    even = even * f2 + constant<L>(1.0178062426976924e-07);
    even = even * f2 + constant<L>(1.525273382986708e-05);
    even = even * f2 + constant<L>(0.0013333558146416691);
    even = even * f2 + constant<L>(0.0555041086648216);
    even = even * f2 + constant<L>(0.6931471805599453);
    L odd = constant<L>(7.072593027878997e-09);
    odd = odd * f2 + constant<L>(1.3215442552522291e-06);
    odd = odd * f2 + constant<L>(0.00015403530441794136);
    odd = odd * f2 + constant<L>(0.009618129107606854);
    odd = odd * f2 + constant<L>(0.24022650695910097);
    const L e = (constant<L>(1.0) + (even * f + odd * f2)) * power;
    const L t = (constant<L>(1.0) - e) / (constant<L>(1.0) + e);
    slope = constant<L>(1.0) - t * t;
    x = t;
  }
};

/// Layers with x / sqrt(1 + x^2).
struct Bent {
  template <class L>
  static GREYBED_HOT void squash(L& x, L& slope) {
    const L inverse = constant<L>(1.0) / root(constant<L>(1.0) + x * x);
    x = x * inverse;
    slope = inverse * inverse * inverse;
  }
};
