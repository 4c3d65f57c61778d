{# A network with all sums in registers, and the derivatives of its values. #}
/// Network: values and spread before their bounds. With slope, slope[4 k + i] is the derivative of
/// value k with respect to feature 4 + i, the ones that the slip moves, and the spread is left out.
inline void network(const double* features, double* raw, double* slope) {
  const v4 zero = {};
  v4 w;
  double in_0[{{ n_features }}];
  for (int i = 0; i < {{ n_features }}; ++i) in_0[i] = (features[i] - mean()[i]) / scale()[i];
{% for n_in, n_out in layers[:-1] %}
{% set at = loop.index0 %}
{% set next = loop.index %}
{% set blocks = n_out // 4 %}
{% for b in range(blocks) %}
  v4 x{{ next }}_{{ b }};
  load(bias_{{ at }}() + {{ 4 * b }}, x{{ next }}_{{ b }});
{% endfor %}
  for (int i = 0; i < {{ n_in }}; ++i) {
    const double* const row = weight_{{ at }}() + {{ n_out }} * i;
{% for b in range(blocks) %}
    load(row + {{ 4 * b }}, w);
    add_scaled(x{{ next }}_{{ b }}, w, in_{{ at }}[i]);
{% endfor %}
  }
{% for b in range(blocks) %}
  v4 s{{ next }}_{{ b }};
  squash(x{{ next }}_{{ b }}, s{{ next }}_{{ b }});
{% endfor %}
{% if not loop.last %}
  double in_{{ next }}[{{ n_out }}];
{% for b in range(blocks) %}
  store(x{{ next }}_{{ b }}, in_{{ next }} + {{ 4 * b }});
{% endfor %}
{% endif %}
{% endfor %}
{% set top = layers|length - 1 %}
{% set wide = layers[top][0] %}
  const int rows = slope == nullptr ? {{ outputs }} : {{ outputs - 1 }};
  for (int k = 0; k < rows; ++k) {
    v4 sum = zero;
{% for b in range(wide // 4) %}
    load(last() + {{ wide }} * k + {{ 4 * b }}, w);
    add_product(sum, w, x{{ top }}_{{ b }});
{% endfor %}
    raw[k] = total(sum) + bias_{{ top }}()[k];
  }
  if (slope == nullptr) return;
{% set values = outputs - 1 %}
{% for k in range(values) %}
  double back{{ k }}_{{ top }}[{{ wide }}];
{% for b in range(wide // 4) %}
  load(last() + {{ wide * k + 4 * b }}, w);
  scale_by(w, s{{ top }}_{{ b }});
  store(w, back{{ k }}_{{ top }} + {{ 4 * b }});
{% endfor %}
{% endfor %}
{% for at in range(top - 1, 0, -1) %}
{% set n_in = layers[at][0] %}
{% set n_out = layers[at][1] %}
{% for k in range(values) %}
{% for b in range(n_in // 4) %}
  v4 r{{ k }}_{{ at }}_{{ b }} = zero;
{% endfor %}
{% endfor %}
  for (int j = 0; j < {{ n_out }}; ++j) {
    const double* const row = turned_{{ at }}() + {{ n_in }} * j;
{% for b in range(n_in // 4) %}
    load(row + {{ 4 * b }}, w);
{% for k in range(values) %}
    add_scaled(r{{ k }}_{{ at }}_{{ b }}, w, back{{ k }}_{{ at + 1 }}[j]);
{% endfor %}
{% endfor %}
  }
{% for k in range(values) %}
  double back{{ k }}_{{ at }}[{{ n_in }}];
{% for b in range(n_in // 4) %}
  scale_by(r{{ k }}_{{ at }}_{{ b }}, s{{ at }}_{{ b }});
  store(r{{ k }}_{{ at }}_{{ b }}, back{{ k }}_{{ at }} + {{ 4 * b }});
{% endfor %}
{% endfor %}
{% endfor %}
{% for k in range(values) %}
  v4 even_{{ k }} = zero;
  v4 odd_{{ k }} = zero;
{% endfor %}
  for (int j = 0; j < {{ layers[0][1] }}; j += 2) {
    load(inward() + 4 * j, w);
{% for k in range(values) %}
    add_scaled(even_{{ k }}, w, back{{ k }}_1[j]);
{% endfor %}
    load(inward() + 4 * j + 4, w);
{% for k in range(values) %}
    add_scaled(odd_{{ k }}, w, back{{ k }}_1[j + 1]);
{% endfor %}
  }
{% for k in range(values) %}
  store(even_{{ k }}, slope + {{ 4 * k }});
  store(odd_{{ k }}, in_0);
  for (int i = 0; i < 4; ++i) slope[{{ 4 * k }} + i] += in_0[i];
{% endfor %}
}

