{# View, wall and exchange factors: the part that belongs to them. #}
{% set names = markers|map(attribute="name")|join(", ") %}
{% set typed = "double " ~ markers|map(attribute="name")|join(", double ") %}
{% set columns_in = "const double* " ~ markers|map(attribute="name")|join(", const double* ") %}
{% set of_row = markers|map(attribute="name")|join("[k], ") ~ "[k]" %}
{% set answer = outputs[0] %}
namespace detail {

{% if of_pairs %}
/// Unobstructed factor: 32-node Gauss-Jacobi rule, relative error below 1e-11.
GREYBED_DEVICE inline double pair_factor(double over_distance, double ratio) {
  const double other = over_distance / ratio;
  const double kappa = 4.0 * over_distance * other;
  const double gap = 1.0 - (over_distance + other) * (over_distance + other);
  const v4 eps = four(gap > 0.0 ? gap : 0.0);  // overlapping spheres count as touching
  v4 sum = four(0.0);
  for (int k = 0; k < 32; k += 4) {
    v4 square;
    v4 weight;
    load(node_square() + k, square);
    load(node_weight() + k, weight);
    sum = sum + weight / (four(1.0) + root(eps + four(kappa) * square));
  }
  return over_distance * over_distance * total(sum);
}

/// The same with its derivatives.
template <int B>
GREYBED_DEVICE inline Dual<B> pair_factor(const Dual<B>& over_distance, const Dual<B>& ratio) {
  const double x = over_distance.v;
  const double other = x / ratio.v;
  const double reach = x + other;
  const double kappa = 4.0 * x * other;
  const double gap = 1.0 - reach * reach;
  const v4 eps = four(gap > 0.0 ? gap : 0.0);
  v4 sum = four(0.0);
  v4 of_eps = four(0.0);
  v4 of_kappa = four(0.0);
  for (int k = 0; k < 32; k += 4) {
    v4 square;
    v4 weight;
    load(node_square() + k, square);
    load(node_weight() + k, weight);
    const v4 size = root(eps + four(kappa) * square);
    const v4 part = four(1.0) / (four(1.0) + size);
    const v4 term = weight * part;
    const v4 slope = term * part / size;
    sum = sum + term;
    of_eps = of_eps + slope;
    of_kappa = of_kappa + slope * square;
  }
  const double all = total(sum);
  const double d_eps = gap > 0.0 ? -0.5 * total(of_eps) : 0.0;
  const double d_kappa = -0.5 * total(of_kappa);
  const double around = -2.0 * reach * d_eps;
  const double of_x = 2.0 * x * all + x * x * (around * (1.0 + 1.0 / ratio.v) + 2.0 * kappa / x * d_kappa);
  const double of_ratio = -x * x * (around * other + kappa * d_kappa) / ratio.v;
  return Dual<B>(x * x * all, of_x, over_distance, of_ratio, ratio);
}

{% endif %}
/// What the markers make: features, and the factor that gate and visibility share out.
template <class T>
struct Parts {
  T features[N_FEATURES];
  T exact;
  T clear;  // 1 - gate
  T gate;
  T baseline;
};

template <class T>
GREYBED_DEVICE inline void parts_of(const T* m, Parts<T>& parts) {
{% for marker in markers %}
  const T& {{ marker.name }} = m[{{ loop.index0 }}];
{% endfor %}
{% for line in formulae.before %}
{% filter wrapped %}
  {{ line }}
{% endfilter %}
{% endfor %}
  T* const features = parts.features;
  // {{ features|map("first")|join("; ") }}
{% for label, formula in features %}
  features[{{ loop.index0 }}] = {{ formula }};
{% endfor %}
  const T exact = {{ formulae.exact }};
  const T clear = {{ formulae.clear }};
  parts.gate = {{ formulae.gate }};
  parts.baseline = {{ formulae.baseline }};
  parts.exact = exact;
  parts.clear = clear;
}

{% if kind == "mlp" %}
/// v in (0, 1): the baseline with its odds bent by at most e^{{ odds_bound }}.
template <class T>
GREYBED_DEVICE inline T unblocked_share(const T& baseline, const T& raw) {
  const T bent = baseline * exp_of({{ odds_bound }} * tanh_of(raw));
  return bent / (1.0 - baseline + bent);
}

{% endif %}
/// The learnt share; inside the training data where inner is not null.
GREYBED_DEVICE inline double learnt(const Parts<double>& parts, const Inner* inner) {
  const double* const features = inner == nullptr ? parts.features : inner->features;
{% if kind == "mlp" %}
  double raw;
  network<1, 0, 0>(features, &raw, nullptr);
  return unblocked_share(parts.baseline, raw);
{% else %}
  double raw[N_RAW];
  forest(features, raw);
  return raw[0];
{% endif %}
}

typedef Dual<{{ (markers|length + 3) // 4 }}> Slopes;

GREYBED_DEVICE inline Slopes learnt(const Parts<Slopes>& parts, const Inner* inner) {
  double features[N_FEATURES];
  for (int i = 0; i < N_FEATURES; ++i) {
    features[i] = inner == nullptr ? parts.features[i].v : inner->features[i];
  }
{% if kind == "mlp" %}
  double value;
  double gradient[N_COLUMNS];
  network<1, 0, BLOCKS>(features, &value, gradient);
  if (inner != nullptr) inner->back(gradient);
  Slopes raw(value);
  for (int i = 0; i < N_FEATURES; ++i) {
    raw = Slopes(value, 1.0, raw, gradient[i], parts.features[i]);
  }
  return unblocked_share(parts.baseline, raw);
{% else %}
  double raw[N_RAW];  // constant between the cuts of a forest
  forest(features, raw);
  return Slopes(raw[0]);
{% endif %}
}

/// 1 - gate (1 - v) without the cancellation where v is small, times the exact part.
template <class T>
GREYBED_DEVICE inline T whole(const Parts<T>& parts, const T& share) {
  return parts.exact * (parts.clear + parts.gate * share);
}

/// Markers as numbers that know their derivatives; those that are held have none.
GREYBED_DEVICE inline void seeded(const double* m, const bool* held, Slopes* out) {
  for (int k = 0; k < N_MARKERS; ++k) {
    double unit[{{ (markers|length + 3) // 4 * 4 }}] = {0.0};
    unit[k] = held[k] ? 0.0 : 1.0;
    out[k].v = m[k];
    out[k].d.get(unit);
  }
{% if of_pairs %}
  // Spheres that are held at their overlap keep it, whatever their ratio.
  if (held[{{ at.radius_over_distance }}]) {
    const Slopes& ratio = out[{{ at.radius_ratio }}];
    const Slopes near = {{ reach }} / (1.0 + 1.0 / ratio);
    if (near.v <= m[{{ at.radius_over_distance }}] * (1.0 + 1e-15)) out[{{ at.radius_over_distance }}] = near;
  }
{% endif %}
}
GREYBED_DEVICE inline void seeded(const double* m, const bool*, double* out) {
  for (int k = 0; k < N_MARKERS; ++k) out[k] = m[k];
}

/// Features as plain numbers.
GREYBED_DEVICE inline void plain(const Parts<double>& parts, double* f) {
  for (int i = 0; i < N_FEATURES; ++i) f[i] = parts.features[i];
}
GREYBED_DEVICE inline void plain(const Parts<Slopes>& parts, double* f) {
  for (int i = 0; i < N_FEATURES; ++i) f[i] = parts.features[i].v;
}

/// One row under a guard.
template <class T>
GREYBED_DEVICE inline Status guarded(const double* given, Guard& guard, T& factor) {
  ++guard.calls;
  double m[N_MARKERS];
  bool held[N_MARKERS];
  const int legal = bring_in(given, m, held);
  if (legal == 2) {
    ++guard.outside;
    ++guard.invalid;
    factor = T(not_a_number());
    return Status::refused;
  }
  T of[N_MARKERS];
  seeded(m, held, of);
  Parts<T> parts;
  parts_of(of, parts);
  double features[N_FEATURES];
  plain(parts, features);
  const bool away = value_of(parts.gate) > 0.0 && outside(features);
  if (legal == 0 && !away) {
    factor = whole(parts, learnt(parts, nullptr));
    return Status::inside;
  }
  ++guard.outside;
  if (guard.policy == Policy::abort) {
    factor = T(not_a_number());
    return Status::refused;
  }
  if (guard.policy == Policy::baseline) {
    factor = whole(parts, parts.baseline);
    return Status::baseline;
  }
  if (guard.policy == Policy::extrapolate) {
    factor = whole(parts, learnt(parts, nullptr));
    return Status::extrapolated;
  }
  const Inner inner(features);
  factor = whole(parts, learnt(parts, &inner));
  return Status::clamped;
}

}  // namespace detail

{% if quantity.output == "wall_factor" %}
namespace detail {
/// Solid angle of the rectangle from the foot of the centre to a corner, signed [sr].
GREYBED_DEVICE inline double corner(double a, double b, double height) {
  const double far = 1e15 * height;  // in place of an infinite edge
  a = a > far ? far : (a < -far ? -far : a);
  b = b > far ? far : (b < -far ? -far : b);
  return std::atan2(a * b, height * std::sqrt(a * a + b * b + height * height));
}
}  // namespace detail

/// wall_share of a flat rectangle, exact: edges along its two sides from the foot of the sphere's
/// centre, and the distance of the centre from the plane, at least the radius (any one unit). Very
/// long edges make a half plane; with all four, an infinite plane, it is 1/2.
GREYBED_DEVICE inline double rectangle_share(double low_a, double high_a, double low_b,
                                             double high_b, double height) {
  const double angle = detail::corner(high_a, high_b, height) - detail::corner(low_a, high_b, height) -
                       detail::corner(high_a, low_b, height) + detail::corner(low_a, low_b, height);
  return angle / 12.566370614359172;
}

{% endif %}
/// {{ quantity.title|capital }}, standard error of the closure, and whether the markers lie outside
/// its training data (never where the law is exact, with the gate at 0).
{% filter wrapped %}
GREYBED_DEVICE inline void predict({{ typed }}, double& {{ answer }}, double& stderr_, bool& extrapolates) {
{% endfilter %}
{% filter wrapped %}
  const double m[detail::N_MARKERS] = { {{- names -}} };
{% endfilter %}
  if (!detail::in_range(m)) {
    {{ answer }} = stderr_ = detail::not_a_number();
    extrapolates = true;
    return;
  }
  detail::Parts<double> parts;
  detail::parts_of(m, parts);
  double raw[detail::N_RAW];
{% if kind == "mlp" %}
  detail::network<detail::N_RAW, 0, 0>(parts.features, raw, nullptr);
  const double share = detail::unblocked_share(parts.baseline, raw[0]);
  const double error = {{ spread_bound }} * detail::logistic(raw[1]);
{% else %}
  detail::forest(parts.features, raw);
  const double share = raw[0];
  const double error = raw[1];
{% endif %}
  {{ answer }} = detail::whole(parts, share);
  stderr_ = parts.exact * parts.gate * error;
  extrapolates = parts.gate > 0.0 && detail::outside(parts.features);
}

/// {{ quantity.title|capital }} [-].
{% filter wrapped %}
GREYBED_DEVICE inline double eval({{ typed }}) {
{% endfilter %}
{% filter wrapped %}
  const double m[detail::N_MARKERS] = { {{- names -}} };
{% endfilter %}
  if (!detail::in_range(m)) return detail::not_a_number();
  detail::Parts<double> parts;
  detail::parts_of(m, parts);
  return detail::whole(parts, detail::learnt(parts, nullptr));
}

/// The same, and gradient[k] = its derivative for marker k{{ ", of all but the forest, which is constant between its cuts" if kind == "forest" }}.
{% filter wrapped %}
GREYBED_DEVICE inline double eval_grad({{ typed }}, double* gradient) {
{% endfilter %}
{% filter wrapped %}
  const double m[detail::N_MARKERS] = { {{- names -}} };
{% endfilter %}
  if (!detail::in_range(m)) {
    for (int k = 0; k < detail::N_MARKERS; ++k) gradient[k] = detail::not_a_number();
    return detail::not_a_number();
  }
  const bool held[detail::N_MARKERS] = {false};
  detail::Slopes of[detail::N_MARKERS];
  detail::seeded(m, held, of);
  detail::Parts<detail::Slopes> parts;
  detail::parts_of(of, parts);
  const detail::Slopes factor = detail::whole(parts, detail::learnt(parts, nullptr));
  double all[{{ (markers|length + 3) // 4 * 4 }}];
  factor.d.put(all);
  for (int k = 0; k < detail::N_MARKERS; ++k) gradient[k] = all[k];
  return factor.v;
}

/// {{ quantity.title|capital }} of n rows.
{% filter wrapped %}
GREYBED_DEVICE inline void eval_batch(std::size_t n, {{ columns_in }}, double* {{ answer }}) {
{% endfilter %}
{% filter wrapped %}
  for (std::size_t k = 0; k < n; ++k) {{ answer }}[k] = eval({{ of_row }});
{% endfilter %}
}

/// Whether all markers are in their ranges, and in the training data where those matter.
{% filter wrapped %}
GREYBED_DEVICE inline bool in_domain({{ typed }}) {
{% endfilter %}
{% filter wrapped %}
  const double m[detail::N_MARKERS] = { {{- names -}} };
{% endfilter %}
  if (!detail::in_range(m)) return false;
  detail::Parts<double> parts;
  detail::parts_of(m, parts);
  return !(parts.gate > 0.0 && detail::outside(parts.features));
}

/// Physical numbers of one place.
struct GREYBED_TYPE Inputs {
{% for field in inputs %}
  double {{ field.name }};  ///< {{ field.meaning }} [{{ field.unit }}]
{% endfor %}
};

/// What a guarded call gives.
struct GREYBED_TYPE Outputs {
  double {{ answer }};  ///< [-]
  double gradient[{{ inputs|length }}];  ///< by eval_grad: its derivatives for the Inputs in their order [1 / their unit]
};

/// {{ quantity.title|capital }} under a guard. In, [-] or as the names say: what a host has.
GREYBED_DEVICE inline Status eval(const Inputs& in, Guard& guard, Outputs& out) {
{% filter wrapped %}
  const double m[detail::N_MARKERS] = { {{- physical|join(", ") -}} };
{% endfilter %}
  return detail::guarded(m, guard, out.{{ answer }});
}

/// The same with derivatives.
GREYBED_DEVICE inline Status eval_grad(const Inputs& in, Guard& guard, Outputs& out) {
{% filter wrapped %}
  const double m[detail::N_MARKERS] = { {{- physical|join(", ") -}} };
{% endfilter %}
  detail::Slopes factor;
  const Status status = detail::guarded(m, guard, factor);
  double of[{{ (markers|length + 3) // 4 * 4 }}];
  factor.d.put(of);
  out.{{ answer }} = factor.v;
{% for field in inputs %}
  out.gradient[{{ loop.index0 }}] = {{ field.chain }};
{% endfor %}
  return status;
}

/// The factors of n rows of markers under a guard.
{% filter wrapped %}
GREYBED_DEVICE inline void eval_batch(std::size_t n, {{ columns_in }}, Guard& guard, double* {{ answer }}) {
{% endfilter %}
  for (std::size_t k = 0; k < n; ++k) {
{% filter wrapped %}
    const double m[detail::N_MARKERS] = { {{- of_row -}} };
{% endfilter %}
    detail::guarded(m, guard, {{ answer }}[k]);
  }
}

/// Whether one golden row comes out, from every function that gives it.
inline bool golden_row(const double* m, const double* wanted) {
  double factor;
  double error;
  bool extrapolates;
  predict({% for marker in markers %}m[{{ loop.index0 }}], {% endfor %}factor, error, extrapolates);
  double batch;
  eval_batch(1, {% for marker in markers %}m + {{ loop.index0 }}, {% endfor %}&batch);
  double gradient[detail::N_MARKERS];
  const double graded = eval_grad({% for marker in markers %}m[{{ loop.index0 }}], {% endfor %}gradient);
  return detail::close(factor, wanted[0]) && detail::close(error, wanted[1]) &&
         detail::close(batch, wanted[0]) && detail::close(graded, wanted[0]);
}

