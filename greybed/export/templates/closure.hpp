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

/// Whether features lie outside the training data.
inline bool outside(const double* features) {
  bool box = false;
  double distance2 = 0.0;
  for (int i = 0; i < {{ features|length }}; ++i) {
    box = box || features[i] < domain_low()[i] || features[i] > domain_high()[i];
    double row = 0.0;
    for (int k = 0; k < {{ features|length }}; ++k) {
      row += domain_precision()[{{ features|length }} * i + k] * (features[k] - domain_centre()[k]);
    }
    distance2 += row * (features[i] - domain_centre()[i]);
  }
  return box || distance2 > {{ limit2 }};
}

{% if kind == "mlp" %}
/// x = tanh(x) to a few 1e-16, in plain arithmetic that becomes vector instructions.
/// No step relies on the order of rounding, so -ffast-math cannot break it.
template <int N>
inline void squash(double* x) {
  double y[N];
  // A loop of its own: a compiler that knows y = -40 in one branch would branch in the next loop.
  for (int j = 0; j < N; ++j) {
    const double wide = -2.0 * std::fabs(x[j]);
    y[j] = wide > -40.0 ? wide : -40.0;  // tanh(20) rounds to 1
  }
  for (int j = 0; j < N; ++j) {
    // e^y = 2^k e^r with |r| <= log(2) / 2; the cast cuts towards zero, which rounds as y <= 0
    const int k = static_cast<int>(y[j] * 1.4426950408889634 - 0.5);
    const double r = (y[j] - k * 0.693147180369123816490) - k * 1.90821492927058770002e-10;
    double e = 1.0 / 6227020800.0;
    e = e * r + 1.0 / 479001600.0;
    e = e * r + 1.0 / 39916800.0;
    e = e * r + 1.0 / 3628800.0;
    e = e * r + 1.0 / 362880.0;
    e = e * r + 1.0 / 40320.0;
    e = e * r + 1.0 / 5040.0;
    e = e * r + 1.0 / 720.0;
    e = e * r + 1.0 / 120.0;
    e = e * r + 1.0 / 24.0;
    e = e * r + 1.0 / 6.0;
    e = e * r + 0.5;
    e = e * r + 1.0;
    e = e * r + 1.0;
    const std::uint64_t bits = static_cast<std::uint64_t>(k + 1023) << 52;
    double power;
    std::memcpy(&power, &bits, sizeof power);
    e *= power;
    x[j] = std::copysign((1.0 - e) / (1.0 + e), x[j]);
  }
}

/// y = x W + b; the neurons run innermost so that they share vector instructions.
template <int N_IN, int N_OUT>
inline void dense(const double* x, const double* weight, const double* bias, double* y) {
  double sum[N_OUT];
  for (int j = 0; j < N_OUT; ++j) sum[j] = bias[j];
  for (int i = 0; i < N_IN; ++i) {
    for (int j = 0; j < N_OUT; ++j) sum[j] += x[i] * weight[i * N_OUT + j];
  }
  for (int j = 0; j < N_OUT; ++j) y[j] = sum[j];
}

/// Network: value and spread before their bounds.
inline void predictor(const double* features, double* raw) {
  double x_0[{{ layers[0][0] }}];
  for (int i = 0; i < {{ layers[0][0] }}; ++i) x_0[i] = (features[i] - mean()[i]) / scale()[i];
{% for n_in, n_out in layers %}
{% if loop.last %}
  dense<{{ n_in }}, {{ n_out }}>(x_{{ loop.index0 }}, weight_{{ loop.index0 }}(), bias_{{ loop.index0 }}(), raw);
{% else %}
  double x_{{ loop.index }}[{{ n_out }}];
  dense<{{ n_in }}, {{ n_out }}>(x_{{ loop.index0 }}, weight_{{ loop.index0 }}(), bias_{{ loop.index0 }}(), x_{{ loop.index }});
  squash<{{ n_out }}>(x_{{ loop.index }});
{% endif %}
{% endfor %}
}

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
/// Forest: mean leaf values. Features are compared in single precision, as they were trained.
inline void predictor(const double* features, double* raw) {
  float single[{{ features|length }}];
  for (int k = 0; k < {{ features|length }}; ++k) single[k] = static_cast<float>(features[k]);
  const std::int8_t* const which = feature();
  const float* const cut = threshold();
  const std::int32_t* const next = following();  // left child, or row of a leaf's values
  double first = 0.0;
  double second = 0.0;
  for (int tree = 0; tree < {{ n_trees }}; ++tree) {
    std::int32_t node = roots()[tree];
    while (which[node] >= 0) node = next[node] + (single[which[node]] > cut[node] ? 1 : 0);
    const double* const leaf = leaf_values() + 2 * static_cast<std::ptrdiff_t>(next[node]);
    first += leaf[0];
    second += leaf[1];
  }
  raw[0] = first / {{ n_trees }}.0;
  raw[1] = second / {{ n_trees }}.0;
}
{% endif %}

inline std::uint64_t as_bits(double v) {
  std::uint64_t bits;
  std::memcpy(&bits, &v, sizeof bits);
  return bits;
}
{% if kind == "forest" %}
inline std::uint64_t as_bits(float v) {
  std::uint32_t bits;
  std::memcpy(&bits, &v, sizeof bits);
  return bits;
}
inline std::uint64_t as_bits(std::int32_t v) {
  return static_cast<std::uint64_t>(static_cast<std::int64_t>(v));
}
inline std::uint64_t as_bits(std::int8_t v) {
  return static_cast<std::uint64_t>(static_cast<std::int64_t>(v));
}
{% endif %}

template <class T>
inline std::uint64_t fnv(std::uint64_t value, const T* data, std::size_t n) {
  for (std::size_t k = 0; k < n; ++k) value = (value ^ as_bits(data[k])) * 0x100000001b3ULL;
  return value;
}

/// Whether every constant of this header is as it was written.
inline bool intact() {
  std::uint64_t value = 0xcbf29ce484222325ULL;
{% for table in tables %}
  value = fnv(value, {{ table.name }}(), {{ table.size }});
{% endfor %}
  return value == {{ checksum }};
}

inline bool close(double value, double expected) {
  const double size = expected < 0.0 ? -expected : expected;
  const double error = value < expected ? expected - value : value - expected;
  return error <= {{ tolerance }} * size;
}

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
