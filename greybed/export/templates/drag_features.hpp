{# Filtered drag: gate and features of markers, with their slopes. #}
/// Exactly 0 for no particles, packed particles and filters of size 0. Slopes for both.
GREYBED_DEVICE inline double gate(double solid_fraction, double filter_size, double* of_fraction,
                                  double* of_size) {
  const double square = filter_size * filter_size;
  const double below = square + {{ gate.filter_scale }} * {{ gate.filter_scale }};
  const double size = square / below;
  const double dilute = solid_fraction / (solid_fraction + {{ gate.dilute_scale }});
  const double ratio = solid_fraction / {{ gate.packing }};
  double power = 1.0;
  for (int k = 1; k < {{ gate.power }}; ++k) power *= ratio;
  const double last = power * ratio;
  // By a choice, so that -ffast-math keeps the exact 0.
  const double dense = solid_fraction < {{ gate.packing }} ? (last < 1.0 ? 1.0 - last : 0.0) : 0.0;
  if (of_fraction != nullptr) {
    const double thin = {{ gate.dilute_scale }} / ((solid_fraction + {{ gate.dilute_scale }}) * (solid_fraction + {{ gate.dilute_scale }}));
    *of_fraction = size * dense * (thin * dense - 2.0 * dilute * ({{ gate.power }} * power / {{ gate.packing }}));
    *of_size = 2.0 * filter_size * ({{ gate.filter_scale }} * {{ gate.filter_scale }}) / (below * below) * dilute * (dense * dense);
  }
  return size * dilute * (dense * dense);
}

/// What the predictor sees, and with it the derivatives of features for the slip: see features.py.
struct Features {
  double value[N_FEATURES];
  double bent_up;          // of slip_up
  double log_across;       // of slip_across squared
{% if gradient %}
  double up_of_slip;       // log of q up: of slip_up
  double up_of_ratio;      // ... of drag_ratio
  double up_of_pull;       // ... of gradient_up
  double across_of_slip;   // log of q across: of slip_across squared
  double across_of_work;   // ... of gradient_work
  double across_of_ratio;  // ... of drag_ratio
  double bent_pull;        // of gradient_up
{% endif %}
};

GREYBED_HOT double bend(double x, double bound, double* slope) {
  const double y = x * (1.0 / bound);
  const double inverse = 1.0 / std::sqrt(1.0 + y * y);
  *slope = inverse * inverse * inverse;
  return x * inverse;
}

{% if gradient %}
/// A smooth positive part, and the slope of its logarithm.
GREYBED_HOT double positive(double q, double* slope) {
  const double root = std::sqrt(q * q + {{ small.ratio }} * {{ small.ratio }});
  const double size = root + (q < 0.0 ? -q : q);
  *slope = 1.0 / root;
  return q >= 0.0 ? 0.5 * size : 0.5 * {{ small.ratio }} * {{ small.ratio }} / size;
}

{% endif %}
GREYBED_DEVICE inline void features_of(const double* m, double log_reynolds, Features* f) {
  const double phi = m[0];
  const double up = m[3];
  const double across2 = m[4] * m[4];
  f->value[0] = phi;
  f->value[3] = log_reynolds;
  f->value[4] = bend(up, {{ small.slip_bend }}, &f->bent_up);
  f->log_across = 1.0 / (across2 + {{ small.across }});
  double three[4];
  store(log_lanes(four(phi + {{ small.dilute }}, m[1] + {{ small.filter }}, across2 + {{ small.across }}, 1.0)), three);
  f->value[1] = three[0];
  f->value[2] = three[1];
  f->value[5] = three[2];
{% if gradient %}
  const double inverse_scale = 1.0 / ((phi + {{ small.fraction }}) * m[7]);
  const double inverse_ratio = (phi + {{ small.fraction }}) * inverse_scale;
  const double up2 = 1.0 / (up * up + {{ small.slip2 }});
  const double wide = 1.0 / (across2 + {{ small.slip2 }});
  const double of_pull = up * (inverse_scale * up2);
  const double of_work = inverse_scale * wide;
  const double q_up = m[5] * of_pull;
  const double q_across = m[6] * of_work;
  double slope_up;
  double slope_across;
  double two[4];
  store(log_lanes(four(positive(q_up, &slope_up), positive(q_across, &slope_across), 1.0, 1.0)), two);
  f->value[6] = two[0];
  f->value[7] = two[1];
  f->value[8] = bend(m[5], {{ small.gradient_bend }}, &f->bent_pull);
  f->up_of_pull = slope_up * of_pull;
  f->up_of_slip = slope_up * m[5] * ({{ small.slip2 }} - up * up) * (inverse_scale * up2 * up2);
  f->up_of_ratio = -slope_up * q_up * inverse_ratio;
  f->across_of_slip = -slope_across * q_across * wide;
  f->across_of_work = slope_across * of_work;
  f->across_of_ratio = -slope_across * q_across * inverse_ratio;
{% endif %}
}

