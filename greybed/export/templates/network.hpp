{# The network of a closure. #}
constexpr int N_RAW = {{ layers[-1][1] }};
constexpr int N_VALUES = {{ layers[-1][1] - 1 }};

{% for isa in ["", "_avx2"] %}
{% set lanes = "shared3::avx2::" if isa else "shared3::" %}
{% if isa %}
#if defined(GREYBED_DISPATCHES)
#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2,fma"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2,fma")
#endif
/// The same for AVX2.
{% else %}
/// The first ROWS outputs before their bounds, of which the last is the spread. With GRADIENT
/// blocks above 0, slope[4 GRADIENT k + i] is the derivative of value k for feature 4 FIRST + i.
{% endif %}
template <int ROWS, int FIRST, int GRADIENT>
GREYBED_DEVICE inline void network_as{{ isa }}(const double* features, double* raw, double* slope) {
  double x_0[N_FEATURES];
  for (int i = 0; i < N_FEATURES; ++i) x_0[i] = (features[i] - mean()[i]) * inverse_scale()[i];
{% for n_in, n_out in layers[:-1] %}
  double x_{{ loop.index }}[{{ n_out }}];
  double s_{{ loop.index }}[{{ n_out }}];
{% if loop.first %}
  {{ lanes }}Layer<{{ n_in }}, {{ n_out }}, {{ n_out // 4 }}>::run(x_0, weight_0(), bias_0(), x_1);
{% else %}
  {{ lanes }}BentLayer<{{ n_in }}, {{ n_out }}, {{ n_out // 4 }}, {{ lanes }}{{ bend }}, (GRADIENT > 0)>::run(x_{{ loop.index0 }}, s_{{ loop.index0 }}, weight_{{ loop.index0 }}(), bias_{{ loop.index0 }}(), x_{{ loop.index }});
{% endif %}
{% if loop.first and reaches %}
  double reach = {{ reaches[0] }};  // bounds what goes into a bend
{% for most in reaches[1:] %}
  reach += (x_0[{{ loop.index0 }}] < 0.0 ? -x_0[{{ loop.index0 }}] : x_0[{{ loop.index0 }}]) * {{ most }};
{% endfor %}
  if (!(reach < {{ far }})) {{ lanes }}hold<{{ n_out }}>(x_1);
{% elif loop.index in held %}
  {{ lanes }}hold<{{ n_out }}>(x_{{ loop.index }});
{% endif %}
{% endfor %}
{% set top = layers|length - 1 %}
{% set wide = layers[top][0] %}
  {{ lanes }}Bending<{{ wide }}, {{ lanes }}{{ bend }}, (GRADIENT > 0)>::run(x_{{ top }}, s_{{ top }});
  for (int k = 0; k < ROWS; ++k) {
    raw[k] = {{ lanes }}dot<{{ wide // 4 }}>(x_{{ top }}, last() + {{ wide }} * k) + bias_{{ top }}()[k];
  }
  if (GRADIENT > 0) {
    double back_{{ top }}[N_VALUES * {{ wide }}];
    for (int k = 0; k < N_VALUES; ++k) {
      {{ lanes }}Sums<{{ wide // 4 }}> sums;
      sums.get(last() + {{ wide }} * k);
      sums.scale_by(s_{{ top }});
      sums.put(back_{{ top }} + {{ wide }} * k);
    }
{% for k in range(top - 1, 0, -1) %}
{% set n_in = layers[k][0] %}
{% set n_out = layers[k][1] %}
    {{ lanes }}Fan<N_VALUES, {{ n_in // 4 }}, {{ n_out }}> fan_{{ k }};
    fan_{{ k }}.set(0.0);
    for (int j = 0; j < {{ n_out }}; ++j) fan_{{ k }}.add(turned_{{ k }}() + {{ n_in }} * j, back_{{ k + 1 }} + j);
    double back_{{ k }}[N_VALUES * {{ n_in }}];
    fan_{{ k }}.put_scaled(s_{{ k }}, back_{{ k }}, {{ n_in }});
{% endfor %}
    // Two chains, for a sum waits for the one before it.
    {{ lanes }}Fan<N_VALUES, GRADIENT, {{ layers[0][1] }}> even;
    {{ lanes }}Fan<N_VALUES, GRADIENT, {{ layers[0][1] }}> odd;
    even.set(0.0);
    odd.set(0.0);
    for (int j = 0; j < {{ layers[0][1] }}; j += 2) {
      even.add(inward() + N_COLUMNS * j + 4 * FIRST, back_1 + j);
      odd.add(inward() + N_COLUMNS * (j + 1) + 4 * FIRST, back_1 + j + 1);
    }
    double more[N_VALUES * 4 * GRADIENT + 1];
    even.put(slope, 4 * GRADIENT);
    odd.put(more, 4 * GRADIENT);
    for (int i = 0; i < N_VALUES * 4 * GRADIENT; ++i) slope[i] += more[i];
  }
}
{% if isa %}
#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif
#endif
{% endif %}

{% endfor %}
/// The network, on the way that this processor has.
template <int ROWS, int FIRST, int GRADIENT>
GREYBED_DEVICE inline void network(const double* features, double* raw, double* slope) {
#if defined(GREYBED_DISPATCHES)
  if (has_avx2()) {
    network_as_avx2<ROWS, FIRST, GRADIENT>(features, raw, slope);
    return;
  }
#endif
  network_as<ROWS, FIRST, GRADIENT>(features, raw, slope);
}

