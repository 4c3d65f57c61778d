// {{ name }}: {{ quantity.title }}.
// Written by greybed {{ facts.greybed_version }}; hash {{ facts.hash }}.
// SPDX-License-Identifier: {{ facts.licence }}
//
{% for line in quantity.law %}
//   {{ line }}
{% endfor %}
//
// The learnt part is of the kind {{ kind }}. Markers, in this order:
{% for marker in markers %}
//   {{ "%-22s"|format(marker.name) }}{{ marker.meaning }} [{{ unit }}], in {{ allowed(marker) }}
{% endfor %}
//
// Markers in, as they are:           eval  eval_grad  eval_batch  predict  in_domain
// Physical numbers in, under a Guard: eval  eval_grad  (struct Inputs; the units are in the names)
//
// Without a Guard, markers out of their ranges give NaN and the closure extrapolates as it likes.
// A Guard says what is done outside of the training data (clamp, baseline, abort, extrapolate) and counts. The
// host owns it, one for each thread. All calls with a Guard return what they did as a Status.
//
// C++11 or later, no heap, no threads, no state: call it from as many threads as you like. Call
// self_test() once at the start; anything but 0 means that this build computes wrongly.
#ifndef {{ guard }}
#define {{ guard }}

{% include "shared.hpp" %}

namespace greybed {
namespace {{ name }} {

inline const char* name() { return {{ facts.name|quoted }}; }
/// Version of greybed that wrote this header.
inline const char* version() { return {{ facts.greybed_version|quoted }}; }
/// SHA-256 of what the closure answers; the same in every exported form.
inline const char* hash() {
  return {{ facts.hash|quoted }};
}
/// SHA-256 of the training data; empty where the closure does not say.
inline const char* dataset_hash() {
  return {{ facts.dataset_hash|quoted }};
}
inline const char* licence() { return {{ facts.licence|quoted }}; }
/// How to cite it.
inline const char* citation() {
  return {{ facts.citation|quoted }};
}
{% if convention %}
/// What the answers count.
inline const char* convention() { return {{ convention|quoted }}; }
{% endif %}
/// Names of the markers, in the order of the arguments.
inline const char* markers() {
  return "{{ markers|map(attribute='name')|join(',') }}";
}
/// Names of the answers of predict, before the flag of extrapolation.
inline const char* outputs() {
  return "{{ outputs|join(',') }}";
}

namespace detail {
using namespace greybed::shared3;

{% for table in tables %}
GREYBED_DEVICE inline const {{ table.ctype }}* {{ table.name }}() {
  static const {{ table.ctype }} data[{{ table.room }}] = {
      {{ table.text }}};
  return data;
}

{% endfor %}
{% for table in golden %}
inline const {{ table.ctype }}* {{ table.name }}() {
  static const {{ table.ctype }} data[{{ table.room }}] = {
      {{ table.text }}};
  return data;
}

{% endfor %}
{% include "ranges.hpp" %}
{% if kind == "mlp" %}
{% include "domain.hpp" %}
{% include "network.hpp" %}
{% elif kind == "forest" %}
{% include "domain.hpp" %}
{% include "forest.hpp" %}
{% endif %}
/// Whether every constant of this header is as it was written.
inline bool intact() {
  std::uint64_t value = 0xcbf29ce484222325ULL;
{% for table in tables %}
  value = fnv(value, {{ table.name }}(), {{ table.size }});
{% endfor %}
  return value == {{ checksum }};
}

}  // namespace detail

{% include body %}
/// Number of golden rows, out of {{ rows }}, that do not come out to a relative {{ tolerance }}; one more where
/// a constant of this header was changed. Zero means sound.
inline int self_test() {
  int failing = detail::intact() ? 0 : 1;
  for (int row = 0; row < {{ rows }}; ++row) {
    const double* const m = detail::golden_markers() + {{ markers|length }} * row;
    const double* const wanted = detail::golden_answers() + {{ outputs|length }} * row;
    failing += golden_row(m, wanted) ? 0 : 1;
  }
  return failing;
}

}  // namespace {{ name }}
}  // namespace greybed

#ifdef GREYBED_HIDES
#pragma GCC visibility pop
#undef GREYBED_HIDES
#endif
#undef GREYBED_TYPE

#endif
