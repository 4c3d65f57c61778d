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

/// Layers with tanh, of numbers between -300 and 300. In four steps, between which a layer does its products.
struct Tanh {
  template <class L>
  struct Steps {
    L x;      // number, at last its bend
    L slope;  // at last
    L power;
    L f;
    L f2;
    L p;
    L q;

    GREYBED_HOT void first() {
      // e^(2 x) = 2^y: what rounding y costs is lost where it could be seen.
      x = x * constant<L>(2.8853900817779268);
      rounded(x, f, power);
    }
    GREYBED_HOT void second() {
      f = x - f;
      f2 = f * f;
    }
    GREYBED_HOT void third() {
      // 2^f = (p + f q) / (p - f q) by the values of tanh(f ln(2) / 2) / f = q / p at Chebyshev's
      // nodes of f^2: 1.7e-18 of 2^f. So one division is enough.
      p = (f2 + constant<L>(233.1777519752325)) * f2 + constant<L>(4368.078795177389);
      q = (constant<L>(0.023094399453830353) * f2 + constant<L>(20.2016706494636)) * f2 +
          constant<L>(1513.860750670445);
    }
    GREYBED_HOT void fourth() {
      const L fq = f * q;
      const L up = p + fq;
      const L down = p - fq;
      x = (up * power - down) / (up * power + down);
      slope = constant<L>(1.0) - x * x;
    }
  };
};

/// Layers with x / sqrt(1 + x^2).
struct Bent {
  template <class L>
  struct Steps {
    L x;
    L slope;

    GREYBED_HOT void first() { slope = constant<L>(1.0) + x * x; }
    GREYBED_HOT void second() { slope = root(slope); }
    GREYBED_HOT void third() { slope = constant<L>(1.0) / slope; }
    GREYBED_HOT void fourth() {
      x = x * slope;
      slope = slope * slope * slope;
    }
  };
};

/// Numbers through a bend, and its slopes.
template <class Bend, class L>
GREYBED_HOT void squash(L& x, L& slope) {
  typename Bend::template Steps<L> steps;
  steps.x = x;
  steps.first();
  steps.second();
  steps.third();
  steps.fourth();
  x = steps.x;
  slope = steps.slope;
}
