{# The ranges of markers. #}
constexpr int N_MARKERS = {{ markers|length }};

/// Whether all markers lie in their ranges{{ " and the spheres do not overlap by more than 5 %" if of_pairs }}.
GREYBED_DEVICE inline bool in_range(const double* m) {
  bool sound = true;
  for (int k = 0; k < N_MARKERS; ++k) sound = sound && is_finite(m + k);
{% for marker in markers %}
  sound = sound && m[{{ loop.index0 }}] {{ ">" if marker.low_open else ">=" }} {{ marker.low }}{{ " && m[%d] <= %r"|format(loop.index0, marker.high) if marker.high < 1e300 }};  // {{ marker.name }}
{% endfor %}
{% if of_pairs %}
  sound = sound && m[{{ at.radius_over_distance }}] * (1.0 + 1.0 / m[{{ at.radius_ratio }}]) <= {{ reach }};
{% endif %}
  return sound;
}

/// Brings markers into their ranges. 0: they were; 1: some are held at an end; 2: they make no sense.
GREYBED_DEVICE inline int bring_in(const double* given, double* m, bool* held) {
  bool sensible = true;
  for (int k = 0; k < N_MARKERS; ++k) {
    sensible = sensible && is_finite(given + k);
    m[k] = given[k];
    held[k] = false;
  }
{% for marker in markers %}
{% if marker.low_open %}
  sensible = sensible && m[{{ loop.index0 }}] > {{ marker.low }};
{% else %}
  if (m[{{ loop.index0 }}] < {{ marker.low }}) {
    m[{{ loop.index0 }}] = {{ marker.low }};
    held[{{ loop.index0 }}] = true;
  }
{% endif %}
{% if marker.high < 1e300 %}
  if (m[{{ loop.index0 }}] > {{ marker.high }}) {
    m[{{ loop.index0 }}] = {{ marker.high }};
    held[{{ loop.index0 }}] = true;
  }
{% endif %}
{% endfor %}
  if (!sensible) return 2;
  bool any = false;
  for (int k = 0; k < N_MARKERS; ++k) any = any || held[k];
{% if of_pairs %}
  // Spheres that overlap further count as if they did so by 5 %.
  const double reach = m[{{ at.radius_over_distance }}] * (1.0 + 1.0 / m[{{ at.radius_ratio }}]);
  if (reach > {{ reach }}) {
    m[{{ at.radius_over_distance }}] *= {{ reach }} / reach;
    held[{{ at.radius_over_distance }}] = true;
    any = true;
  }
{% endif %}
  return any ? 1 : 0;
}

