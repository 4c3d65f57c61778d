// {{ name }}: {{ quantity.title }}, with its own standard error.
// Written by greybed {{ meta.greybed_version }}; hash {{ meta.hash }}.
// SPDX-License-Identifier: {{ licence }}
//
//   {{ quantity.law[0] }}
//
{% for line in quantity.law[1:] %}
// {{ line }}
{% endfor %}
// The learnt part is of the kind {{ kind }}. Markers, all dimensionless, in this order:
{% for marker in markers %}
//   {{ "%-22s"|format(marker.name) }}{{ marker.meaning }}, in {{ allowed(marker) }}
{% endfor %}
// Outside these ranges{{ ", or where the spheres overlap by more than 5 %," if of_pairs }} all results are NaN.
// With -ffast-math the compiler assumes that no NaN comes in: check your markers before.
//
// C++11 or later, no heap, no threads, no state: call it from as many threads as you like.
#ifndef {{ guard }}
#define {{ guard }}

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>

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
{% if of_pairs %}
/// Unobstructed factor: 32-node Gauss-Jacobi rule, relative error below 1e-11.
inline double pair_factor(double over_distance, double ratio) {
  const double other = over_distance / ratio;
  const double kappa = 4.0 * over_distance * other;
  const double gap = 1.0 - (over_distance + other) * (over_distance + other);
  const double eps = gap > 0.0 ? gap : 0.0;  // overlapping spheres count as touching
  const double* const square = node_square();
  const double* const weight = node_weight();
  double total = 0.0;
  for (int k = 0; k < 32; ++k) {
    total += weight[k] / (1.0 + std::sqrt(eps + kappa * square[k]));
  }
  return over_distance * over_distance * total;
}

{% endif %}
{% set typed = "double " ~ markers|map(attribute="name")|join(", double ") %}
{% set names = markers|map(attribute="name")|join(", ") %}
/// Whether all markers lie in their ranges{{ " and the spheres do not overlap by more than 5 %" if of_pairs }}.
{% filter wrapped %}
inline bool in_range({{ typed }}) {
{% endfilter %}
{% if of_pairs %}
  bool sound = radius_over_distance * (1.0 + 1.0 / radius_ratio) <= {{ reach }};
{% else %}
  bool sound = true;
{% endif %}
{% for marker in markers %}
  sound = sound && {{ marker.name }} {{ ">" if marker.low_open else ">=" }} {{ marker.low }} && {{ marker.name }} <= {{ marker.high if marker.high < 1e300 else largest }};
{% endfor %}
  return sound;
}

{% include "outside.hpp" %}

{% if kind == "mlp" %}
{% include "network.hpp" %}
/// v in (0, 1): the baseline with its odds bent by at most e^{{ odds_bound }}.
inline double unblocked_share(double baseline, double raw) {
  const double odds = std::exp({{ odds_bound }} * std::tanh(raw));
  return baseline * odds / (1.0 - baseline + baseline * odds);
}

/// Standard error of v, below {{ spread_bound }}.
inline double spread(double raw) {
  const double e = std::exp(raw < 0.0 ? raw : -raw);  // of the negative magnitude: no overflow
  return {{ spread_bound }} * (raw < 0.0 ? e : 1.0) / (1.0 + e);
}
{% else %}
{% set n_trees = tables|selectattr("name", "equalto", "roots")|map(attribute="size")|first %}
{% include "forest.hpp" %}
{% endif %}

{% include "sound.hpp" %}
}  // namespace detail

{% if not of_pairs %}
namespace detail {
/// Solid angle of the rectangle from the foot of the centre to a corner, signed [sr].
inline double corner(double a, double b, double height) {
  const double far = 1e15 * height;  // in place of an infinite edge
  a = a > far ? far : (a < -far ? -far : a);
  b = b > far ? far : (b < -far ? -far : b);
  return std::atan2(a * b, height * std::sqrt(a * a + b * b + height * height));
}
}  // namespace detail

/// wall_share of a flat rectangle, exact: edges along its two sides from the foot of the sphere's
/// centre, and the distance of the centre from the plane, at least the radius (any one unit). Very
/// long edges make a half plane; with all four, an infinite plane, it is 1/2.
inline double rectangle_share(double low_a, double high_a, double low_b, double high_b,
                              double height) {
  const double angle = detail::corner(high_a, high_b, height) - detail::corner(low_a, high_b, height) -
                       detail::corner(high_a, low_b, height) + detail::corner(low_a, low_b, height);
  return angle / 12.566370614359172;
}

{% endif %}
/// {{ quantity.title|capital }}, standard error of the closure, and whether the markers lie outside
/// its training data (never where the law is exact, with the gate at 0).
{% filter wrapped %}
inline void predict({{ typed }}, double& factor, double& stderr_, bool& extrapolates) {
{% endfilter %}
  if (!detail::in_range({{ names }})) {
    factor = stderr_ = std::numeric_limits<double>::quiet_NaN();
    extrapolates = true;
    return;
  }
{% for line in formulae.before %}
{% filter wrapped %}
  {{ line }}
{% endfilter %}
{% endfor %}
  // {{ features|map("first")|join("; ") }}
  double features[{{ features|length }}];
{% for label, formula in features %}
  features[{{ loop.index0 }}] = {{ formula }};
{% endfor %}
  const double exact = {{ formulae.exact }};
  const double clear = {{ formulae.clear }};  // 1 - gate
  const double gate = {{ formulae.gate }};
  double raw[2];
  detail::predictor(features, raw);
{% if kind == "mlp" %}
  const double baseline = {{ formulae.baseline }};
  const double share = detail::unblocked_share(baseline, raw[0]);
  const double error = detail::spread(raw[1]);
{% else %}
  const double share = raw[0];
  const double error = raw[1];
{% endif %}
  // 1 - gate (1 - v) without the cancellation where v is small
  factor = exact * (clear + gate * share);
  stderr_ = exact * gate * error;
  extrapolates = gate > 0.0 && detail::outside(features);
}

/// {{ quantity.title|capital }} [-].
{% filter wrapped %}
inline double evaluate({{ typed }}) {
{% endfilter %}
  double factor;
  double stderr_;
  bool extrapolates;
{% filter wrapped %}
  predict({{ names }}, factor, stderr_, extrapolates);
{% endfilter %}
  return factor;
}

/// The same of n rows.
{% filter wrapped %}
inline void evaluate_batch(std::size_t n, const double* {{ markers|map(attribute="name")|join(", const double* ") }}, double* factor) {
{% endfilter %}
  for (std::size_t k = 0; k < n; ++k) {
{% filter wrapped %}
    factor[k] = evaluate({{ markers|map(attribute="name")|join("[k], ") }}[k]);
{% endfilter %}
  }
}

/// Number of golden rows, out of {{ rows }}, that do not come out to a relative {{ tolerance }}; one more where
/// a constant of this header was changed. Zero means sound.
inline int self_test() {
  int failing = detail::intact() ? 0 : 1;
  double batch[{{ rows }}];
{% filter wrapped %}
  evaluate_batch({{ rows }}, {% for marker in markers %}detail::golden_{{ marker.name }}(), {% endfor %}batch);
{% endfilter %}
  for (int k = 0; k < {{ rows }}; ++k) {
    double factor;
    double stderr_;
    bool extrapolates;
{% filter wrapped %}
    predict({% for marker in markers %}detail::golden_{{ marker.name }}()[k], {% endfor %}factor, stderr_, extrapolates);
{% endfilter %}
    const bool sound = detail::close(factor, detail::golden_factor()[k]) &&
                       detail::close(batch[k], detail::golden_factor()[k]) &&
                       detail::close(stderr_, detail::golden_stderr()[k]);
    failing += sound ? 0 : 1;
  }
  return failing;
}

}  // namespace {{ name }}
}  // namespace greybed

#endif
