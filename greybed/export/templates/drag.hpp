// {{ name }}: filtered drag, as the fraction kept of the drag law, and its derivative.
// Written by greybed {{ meta.greybed_version }}; hash {{ meta.hash }}.
// SPDX-License-Identifier: {{ licence }}
//
{% for line in quantity.law %}
//   {{ line }}
{% endfor %}
//
// H is the fraction that is KEPT (1 means no correction). The learnt part is of the kind {{ kind }}.
// The slip is gas less solids. Markers, all dimensionless, in this order:
{% for marker in markers %}
//   {{ "%-20s"|format(marker.name) }}{{ marker.meaning }}, in {{ allowed(marker) }}
{% endfor %}
// Outside these ranges all results are NaN. With -ffast-math the compiler assumes that no NaN comes
// in: check your numbers before.
//
// eval_grad does all of it from physical numbers, SI: make a Material once, give F and Re dF/dRe of
// your drag law. Training data had the drag law {{ law }}; wen_yu below is at hand.
//
// C++11 or later, no heap, no threads, no state: call it from as many threads as you like.
#ifndef {{ guard }}
#define {{ guard }}

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#ifdef __AVX__
#include <immintrin.h>
#endif

namespace greybed {
namespace {{ name }} {

inline const char* name() { return {{ meta.name|quoted }}; }
/// Version of greybed that wrote this header.
inline const char* version() { return {{ meta.greybed_version|quoted }}; }
/// SHA-256 of what the closure answers; the same in every exported form.
inline const char* hash() {
  return {{ meta.hash|quoted }};
}
/// SHA-256 of the training data; empty where the closure does not say.
inline const char* dataset_hash() {
  return {{ dataset_hash|quoted }};
}
inline const char* licence() { return {{ licence|quoted }}; }
/// What H counts.
inline const char* convention() { return "fraction kept"; }
/// Names of the markers, in the order of the arguments.
inline const char* markers() {
  return "{{ markers|map(attribute='name')|join(',') }}";
}

namespace detail {

{% for table in tables + golden %}
inline const {{ table.ctype }}* {{ table.name }}() {
  static const {{ table.ctype }} data[{{ table.size }}] = {
      {{ table.text }}};
  return data;
}

{% endfor %}
{% set n_markers = markers|length %}
{% set n_features = features|length %}
{% set values = outputs - 1 %}
/// Whether all markers lie in their ranges.
inline bool in_range(const double* m) {
  bool sound = true;
{% for marker in markers %}
  sound = sound && m[{{ loop.index0 }}] {{ ">" if marker.low_open else ">=" }} {{ marker.low }} && m[{{ loop.index0 }}] <= {{ marker.high }};  // {{ marker.name }}
{% endfor %}
  return sound;
}

{% include "vectors.hpp" %}
/// Whether features lie outside the training data.
inline bool outside(const double* features) {
  bool box = false;
  double away[{{ n_features }}];
{% for b in range(columns // 4) %}
  v4 row_{{ b }} = {};
{% endfor %}
  v4 w;
  for (int i = 0; i < {{ n_features }}; ++i) {
    box = box || features[i] < domain_low()[i] || features[i] > domain_high()[i];
    away[i] = features[i] - domain_centre()[i];
{% for b in range(columns // 4) %}
    load(domain_precision() + {{ columns }} * i + {{ 4 * b }}, w);
    add_scaled(row_{{ b }}, w, away[i]);
{% endfor %}
  }
  double all[{{ columns }}];
{% for b in range(columns // 4) %}
  store(row_{{ b }}, all + {{ 4 * b }});
{% endfor %}
  double distance2 = 0.0;
  for (int i = 0; i < {{ n_features }}; ++i) distance2 += all[i] * away[i];
  return box || distance2 > {{ limit2 }};
}

{% if kind == "mlp" %}
{% include "drag_network.hpp" %}
{% else %}
{% set n_trees = tables|selectattr("name", "equalto", "roots")|map(attribute="size")|first %}
{% include "forest.hpp" %}
{% endif %}
{% include "sound.hpp" %}
/// 1 / (1 + e^-x) without overflow.
inline double logistic(double x) {
  const double e = std::exp(x < 0.0 ? x : -x);
  return (x < 0.0 ? e : 1.0) / (1.0 + e);
}

/// Exactly 0 for no particles, packed particles and filters of size 0.
inline double gate(double solid_fraction, double filter_size) {
  const double square = filter_size * filter_size;
  const double size = square / (square + {{ gate.filter_scale }} * {{ gate.filter_scale }});
  const double dilute = solid_fraction / (solid_fraction + {{ gate.dilute_scale }});
  const double ratio = solid_fraction / {{ gate.packing }};
  double power = ratio;
  for (int k = 1; k < {{ gate.power }}; ++k) power *= ratio;
  // By a choice, so that -ffast-math keeps the exact 0.
  const double dense = solid_fraction < {{ gate.packing }} ? (power < 1.0 ? 1.0 - power : 0.0) : 0.0;
  return size * dilute * (dense * dense);
}

/// What the predictor sees, and with it the derivatives of features for the slip: see features.py.
struct Features {
  double value[{{ n_features }}];
  double bent_up;          // of slip_up
  double log_across;       // of slip_across squared
{% if gradient %}
  double up_of_slip;       // log of q up: of slip_up
  double up_of_ratio;      // ... of drag_ratio
  double across_of_slip;   // log of q across: of slip_across squared
  double across_of_work;   // ... of gradient_work
  double across_of_ratio;  // ... of drag_ratio
{% endif %}
};

inline double bend(double x, double bound, double* slope) {
  const double y = x / bound;
  const double root = std::sqrt(1.0 + y * y);
  *slope = 1.0 / (root * root * root);
  return x / root;
}

{% if gradient %}
/// Logarithm of a smooth positive part.
inline double log_positive(double q, double* slope) {
  const double root = std::sqrt(q * q + {{ small.ratio }} * {{ small.ratio }});
  const double size = root + (q < 0.0 ? -q : q);
  *slope = 1.0 / root;
  return std::log(q >= 0.0 ? 0.5 * size : 0.5 * {{ small.ratio }} * {{ small.ratio }} / size);
}

{% endif %}
inline void features_of(const double* m, double log_reynolds, Features* f) {
  const double phi = m[0];
  const double up = m[3];
  const double across2 = m[4] * m[4];
  f->value[0] = phi;
  f->value[1] = std::log(phi + {{ small.dilute }});
  f->value[2] = std::log(m[1] + {{ small.filter }});
  f->value[3] = log_reynolds;
  f->value[4] = bend(up, {{ small.slip_bend }}, &f->bent_up);
  f->value[5] = std::log(across2 + {{ small.across }});
  f->log_across = 1.0 / (across2 + {{ small.across }});
{% if gradient %}
  const double scale = (phi + {{ small.fraction }}) * m[7];
  const double up2 = up * up + {{ small.slip2 }};
  const double wide = across2 + {{ small.slip2 }};
  const double q_up = m[5] * up / (scale * up2);
  const double q_across = m[6] / (scale * wide);
  double slope_up;
  double slope_across;
  double unused;
  f->value[6] = log_positive(q_up, &slope_up);
  f->value[7] = log_positive(q_across, &slope_across);
  f->value[8] = bend(m[5], {{ small.gradient_bend }}, &unused);
  f->up_of_slip = slope_up * m[5] * ({{ small.slip2 }} - up * up) / (scale * up2 * up2);
  f->up_of_ratio = -slope_up * q_up / m[7];
  f->across_of_slip = -slope_across * q_across / wide;
  f->across_of_work = slope_across / (scale * wide);
  f->across_of_ratio = -slope_across * q_across / m[7];
{% endif %}
}

/// Kept fractions and, in the rows of slope, derivatives of ln H along, ln H across and the share
/// with respect to slip_up, slip_across squared, gradient_work and drag_ratio. Slopes come without
/// the standard error: who wants the one does not want the other, and both take time.
struct Kept {
  double along;
  double across;
  double share;
  double stderr_;
  bool extrapolates;
  double slope[3][4];
};

inline void kept(const double* m, double log_reynolds, bool slopes, Kept* out) {
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i < 4; ++i) out->slope[k][i] = 0.0;
  }
  if (!in_range(m)) {
    out->along = out->across = out->share = out->stderr_ = std::numeric_limits<double>::quiet_NaN();
    out->extrapolates = true;
    return;
  }
  Features f;
  features_of(m, log_reynolds, &f);
  const double g = gate(m[0], m[1]);
  double raw[{{ outputs }}];
{% if kind == "mlp" %}
  double inner[4 * {{ values }}];
  network(f.value, raw, slopes ? inner : nullptr);
  double bent[2];
  const double log_along = bend(raw[0], {{ log_bound }}, bent);
  const double log_across = bend(raw[1], {{ log_bound }}, bent + 1);
  if (slopes) {
    double outer[{{ values }}];
    outer[0] = g * bent[0];
    outer[1] = g * bent[1];
{% if outputs == 4 %}
    const double part = logistic(raw[2]);
    outer[2] = g * {{ share_bound }} * part * (1.0 - part);
{% endif %}
    for (int k = 0; k < {{ values }}; ++k) {
      const double* const of = inner + 4 * k;
      out->slope[k][0] = outer[k] * of[0] * f.bent_up;
      out->slope[k][1] = outer[k] * of[1] * f.log_across;
{% if gradient %}
      out->slope[k][0] += outer[k] * of[2] * f.up_of_slip;
      out->slope[k][1] += outer[k] * of[3] * f.across_of_slip;
      out->slope[k][2] = outer[k] * of[3] * f.across_of_work;
      out->slope[k][3] = outer[k] * (of[2] * f.up_of_ratio + of[3] * f.across_of_ratio);
{% endif %}
    }
  }
  const double spread = slopes ? 0.0 : {{ spread_bound }} * logistic(raw[{{ values }}]);
{% else %}
  (void)slopes;  // constant between the cuts of a forest
  predictor(f.value, raw);
  const double log_along = raw[0];
  const double log_across = raw[1];
  const double spread = raw[{{ values }}];
{% endif %}
  const double parcels = {{ parcel_rate }} * (m[{{ n_markers - 1 }}] - 1.0);
  out->along = std::exp(g * (log_along - parcels));
  out->across = std::exp(g * (log_across - parcels));
  out->share = {{ "g * " ~ share_bound ~ " * logistic(raw[2])" if outputs == 4 else "0.0" }};
  out->stderr_ = out->along * (g * spread);
  out->extrapolates = g > 0.0 && outside(f.value);
}

}  // namespace detail

{% set typed = "double " ~ markers|map(attribute="name")|join(", double ") %}
/// Kept fractions, standard error of the closure (of kept_along; as much in proportion across), and
/// whether the markers lie outside its training data (never where the gate is shut).
{% filter wrapped %}
inline void predict({{ typed }}, double& kept_along, double& kept_across, double& share, double& stderr_, bool& extrapolates) {
{% endfilter %}
  const double m[{{ n_markers }}] = {
      {{ markers|map(attribute="name")|join(", ") }}};
  detail::Kept k;
  detail::kept(m, std::log(terminal_reynolds), false, &k);
  kept_along = k.along;
  kept_across = k.across;
  share = k.share;
  stderr_ = k.stderr_;
  extrapolates = k.extrapolates;
}

/// Particles of one size in a gas under gravity, and what filtered drag is scaled with; SI.
struct Material {
  double diameter;           // [m]
  double gas_viscosity;      // [Pa s]
  double gas_weight;         // rho_g g [N m-3]
  double up[3];              // against gravity [-]
  double weight;             // (rho_p - rho_g) g [N m-3]
  double terminal_velocity;  // [m s-1]
  double terminal_reynolds;  // [-]
  double log_reynolds;       // its logarithm
  double terminal_drag;      // F of one settling particle [-]
  double length;             // L_c [m]
};

/// F of Schiller & Naumann times (1 - phi)^-3.65 (Wen & Yu), and Re dF/dRe in slope.
inline double wen_yu(double solid_fraction, double reynolds, double* slope) {
  const double swarm = std::pow(1.0 - solid_fraction, -3.65);
  const bool slow = reynolds < 1000.0;
  const double part = slow ? 0.15 * std::pow(reynolds, 0.687) : 0.44 * reynolds / 24.0;
  *slope = swarm * (slow ? 0.687 * part : part);
  return swarm * (slow ? 1.0 + part : part);
}

/// Make a material; particles must be heavier than the gas, gravity must not be 0.
inline Material material(double diameter, double particle_density, double gas_density,
                         double gas_viscosity, const double* gravity) {
  Material m;
  const double g = std::sqrt(gravity[0] * gravity[0] + gravity[1] * gravity[1] +
                             gravity[2] * gravity[2]);
  for (int i = 0; i < 3; ++i) m.up[i] = -gravity[i] / g;
  m.diameter = diameter;
  m.gas_viscosity = gas_viscosity;
  m.gas_weight = gas_density * g;
  m.weight = (particle_density - gas_density) * g;
  const double stokes = m.weight * diameter * diameter / (18.0 * gas_viscosity);
  double low = 0.0;
  double high = stokes;
  double slope;
  // Drag grows with velocity, so halving finds the one root whatever the jump at Re = 1000.
  for (int k = 0; k < 100; ++k) {
    const double middle = 0.5 * (low + high);
    const double drag = wen_yu(0.0, gas_density * diameter / gas_viscosity * middle, &slope);
    if (middle * drag < stokes) {
      low = middle;
    } else {
      high = middle;
    }
  }
  m.terminal_velocity = 0.5 * (low + high);
  m.terminal_reynolds = gas_density * m.terminal_velocity * diameter / gas_viscosity;
  m.log_reynolds = std::log(m.terminal_reynolds);
  m.terminal_drag = stokes / m.terminal_velocity;
  m.length = diameter * std::cbrt(m.terminal_velocity * m.terminal_velocity / (g * diameter));
  return m;
}

/// Filtered drag on the particles in a unit volume and its derivative.
///
/// solid_fraction [-]; slip: gas less solids [m s-1]; pressure_gradient [Pa m-1], used by closures
/// that see it; filter_size [m]; drag and steep: F and Re dF/dRe of your drag law at these fields;
/// parcels: their diameter over the particles' [-]. Out: force[3] [N m-3] and, unless it is null,
/// derivative[3 i + j] = dF_i / dslip_j [N s m-4]. Returns whether it extrapolates.
inline bool eval_grad(const Material& m, double solid_fraction, const double* slip,
                      const double* pressure_gradient, double filter_size, double drag,
                      double steep, double parcels, double* force, double* derivative) {
  const double u_t = m.terminal_velocity;
  const double s_up = slip[0] * m.up[0] + slip[1] * m.up[1] + slip[2] * m.up[2];
  double lateral[3];
  double across2 = 0.0;
  double speed2 = 0.0;
  for (int i = 0; i < 3; ++i) {
    lateral[i] = slip[i] - s_up * m.up[i];
    across2 += lateral[i] * lateral[i];
    speed2 += slip[i] * slip[i];
  }
{% if pressure %}
  double fall[3];
  for (int i = 0; i < 3; ++i) fall[i] = -pressure_gradient[i] - m.gas_weight * m.up[i];
{% else %}
  (void)pressure_gradient;
{% endif %}
{% if gradient %}
  const double fall_up = fall[0] * m.up[0] + fall[1] * m.up[1] + fall[2] * m.up[2];
  double fall_across[3];
  double work = 0.0;
  for (int i = 0; i < 3; ++i) {
    fall_across[i] = fall[i] - fall_up * m.up[i];
    work += fall[i] * lateral[i];
  }
{% endif %}
  const double marker[{{ n_markers }}] = {solid_fraction, filter_size / m.length, m.terminal_reynolds, s_up / u_t,
                           std::sqrt(across2) / u_t,
{% if gradient %}
                           fall_up / m.weight, work / (m.weight * u_t), drag / m.terminal_drag,
{% endif %}
                           parcels};
  detail::Kept kept;
  detail::kept(marker, m.log_reynolds, derivative != nullptr, &kept);
  const double beta = 18.0 * m.gas_viscosity * (1.0 - solid_fraction) * solid_fraction * drag /
                      (m.diameter * m.diameter);
  const double up_part = beta * kept.along;
  const double across_part = beta * kept.across;
  for (int i = 0; i < 3; ++i) force[i] = up_part * s_up * m.up[i] + across_part * lateral[i];
  double change[{{ 3 if outputs == 4 else 2 }}][3];  // of ln H along and across{{ ", and of the share" if outputs == 4 }}
  if (derivative != nullptr) {
    const double relative = steep / (drag * (speed2 > 1e-300 ? speed2 : 1e-300));
    const double of_up = 1.0 / u_t;
    const double of_lateral = 2.0 * of_up * of_up;
{% if gradient %}
    const double of_fall = of_up / m.weight;
{% endif %}
    const double of_ratio = drag / m.terminal_drag * relative;
    for (int k = 0; k < {{ 3 if outputs == 4 else 2 }}; ++k) {
      const double* const s = kept.slope[k];
      for (int j = 0; j < 3; ++j) {
        change[k][j] = s[0] * of_up * m.up[j] + s[1] * of_lateral * lateral[j]{{ " + s[2] * of_fall * fall_across[j]" if gradient }} +
                       s[3] * of_ratio * slip[j];
      }
    }
    for (int j = 0; j < 3; ++j) {
      const double along = relative * slip[j] + change[0][j];
      const double across = relative * slip[j] + change[1][j];
      for (int i = 0; i < 3; ++i) {
        const double outer = m.up[i] * m.up[j];
        derivative[3 * i + j] = up_part * (outer + s_up * m.up[i] * along) +
                                across_part * ((i == j ? 1.0 : 0.0) - outer + lateral[i] * across);
      }
    }
  }
{% if outputs == 4 %}
  // The share of the gradient's force fades before it could drive the gas: see force.py.
  const double whole = kept.share;
  double pull[3];
  double done = 0.0;
  double against = 0.0;
  double pull2 = 0.0;
  for (int i = 0; i < 3; ++i) {
    pull[i] = (1.0 - solid_fraction) * fall[i];
    done += force[i] * slip[i];
    against += pull[i] * slip[i];
    pull2 += pull[i] * pull[i];
  }
  const double small2 = {{ fade }} * u_t * ({{ fade }} * u_t) * pull2;
  const double root = std::sqrt(against * against + small2);
  const double sum = root > 0.0 ? root + (against < 0.0 ? -against : against) : 1.0;
  const double n = against < 0.0 ? 0.5 * sum : 0.5 * small2 / sum;
  const double below = done + whole * n;
  const double safe = below > 0.0 ? below : 1.0;
  const double share = whole * done / safe;
  if (derivative != nullptr) {
    const double part = 1.0 / safe;
    const double of_whole = done * part * (done * part);
    const double both = whole * part * (whole * part);
    const double of_work = both * n;
    const double of_n = -both * done * 0.5 * (against / (root > 0.0 ? root : 1.0) - 1.0);
    double of_share[3];
    for (int j = 0; j < 3; ++j) {
      double work_slope = force[j];
      for (int i = 0; i < 3; ++i) work_slope += derivative[3 * i + j] * slip[i];
      of_share[j] = of_whole * change[2][j] + of_work * work_slope + of_n * pull[j];
    }
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        derivative[3 * i + j] =
            (1.0 - share) * derivative[3 * i + j] + (pull[i] - force[i]) * of_share[j];
      }
    }
  }
  for (int i = 0; i < 3; ++i) force[i] = (1.0 - share) * force[i] + share * pull[i];
{% endif %}
  return kept.extrapolates;
}

/// The same without the derivative.
inline bool eval(const Material& m, double solid_fraction, const double* slip,
                 const double* pressure_gradient, double filter_size, double drag, double parcels,
                 double* force) {
  return eval_grad(m, solid_fraction, slip, pressure_gradient, filter_size, drag, 0.0, parcels,
                   force, nullptr);
}

/// Number of golden rows, out of {{ rows }}, that do not come out to a relative {{ tolerance }}; one more where
/// a constant of this header was changed. Zero means sound.
inline int self_test() {
  int failing = detail::intact() ? 0 : 1;
  for (int row = 0; row < {{ rows }}; ++row) {
    detail::Kept k;
    const double* const m = detail::golden_markers() + {{ n_markers }} * row;
    detail::kept(m, std::log(m[2]), false, &k);
    const double* const wanted = detail::golden_answers() + 4 * row;
    const bool sound = detail::close(k.along, wanted[0]) && detail::close(k.across, wanted[1]) &&
                       detail::close(k.share, wanted[2]) && detail::close(k.stderr_, wanted[3]);
    failing += sound ? 0 : 1;
  }
  return failing;
}

}  // namespace {{ name }}
}  // namespace greybed

#endif
