/* {{ name }}: {{ quantity.title }}. C interface of {{ name }}.hpp.
 * Written by greybed {{ facts.greybed_version }}; hash {{ facts.hash }}.
 * SPDX-License-Identifier: {{ facts.licence }}
 *
 * Open it once; that replays the golden rows. A build whose rows fail does not open, and says so.
 * No heap, no threads, no state: what is opened is constant. Policies: 0 clamp, 1 baseline, 2 abort,
 * 3 extrapolate. Status of guarded calls: 0 inside, 1 clamped, 2 baseline, 3 refused (NaN),
 * 4 extrapolated; {{ name|upper }}_NOT_OPEN where the library is a null pointer.
 */
#ifndef GREYBED_{{ name|upper }}_H
#define GREYBED_{{ name|upper }}_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Version of this interface; give it to open. */
#define {{ name|upper }}_ABI 1
#define {{ name|upper }}_NOT_OPEN (-1)
#define {{ name|upper }}_MARKERS {{ markers|length }}
#define {{ name|upper }}_ANSWERS {{ n_answers }}
#define {{ name|upper }}_OUTPUTS {{ outputs|length }}
#define {{ name|upper }}_INPUTS {{ flat|length }}

typedef struct {{ name }}_library {{ name }}_library;

/* Policy and counts; the host owns it, one for each thread. */
typedef struct {{ name }}_guard {
  int64_t policy;
  uint64_t calls;
  uint64_t outside;
  uint64_t invalid;
} {{ name }}_guard;

/* Null, and a message, where the host was compiled for another interface, or golden rows fail. */
const {{ name }}_library* {{ name }}_open(int abi, char* message, size_t size);

int {{ name }}_abi(void);
const char* {{ name }}_name(void);
const char* {{ name }}_version(void);
const char* {{ name }}_hash(void);
const char* {{ name }}_dataset_hash(void);
const char* {{ name }}_licence(void);
const char* {{ name }}_citation(void);
const char* {{ name }}_markers(void);
const char* {{ name }}_outputs(void);
/* For which processor the library runs: "avx2" or "default". */
const char* {{ name }}_target(const {{ name }}_library* library);

/* Markers [{{ unit }}], in this order:
{% for marker in markers %}
 *   {{ "%-22s"|format(marker.name) }}{{ marker.meaning }}, in {{ allowed(marker) }}
{% endfor %}
 * Answers: {{ outputs[:n_answers]|join(", ") }}. They are NaN where a marker is out of range. */
int {{ name }}_eval(const {{ name }}_library* library, const double* markers, double* answers);
/* gradient[{{ markers|length }} k + i] = derivative of answer k for marker i. */
int {{ name }}_eval_grad(const {{ name }}_library* library, const double* markers, double* answers,
    double* gradient);
/* n rows, one after the other. */
int {{ name }}_eval_batch(const {{ name }}_library* library, size_t n, const double* markers,
    double* answers);
/* Outputs: {{ outputs|join(", ") }}. */
int {{ name }}_predict(const {{ name }}_library* library, const double* markers, double* outputs,
    int* extrapolates);
/* 1 or 0. */
int {{ name }}_in_domain(const {{ name }}_library* library, const double* markers);

{% if with_material %}
/* Particles in a gas under gravity: make it once. */
typedef struct {{ name }}_material {
  double numbers[{{ n_material }}];
} {{ name }}_material;

int {{ name }}_make_material(const {{ name }}_library* library, double diameter_m,
    double particle_density_kg_m3, double gas_density_kg_m3, double gas_viscosity_pa_s,
    const double* gravity_m_s2, {{ name }}_material* material);

/* Under a guard, from numbers of the coarse grid, in this order:
{% else %}
/* Under a guard, from physical numbers, in this order:
{% endif %}
{% for field in flat %}
 *   {{ "%-26s"|format(field.name) }}{{ field.meaning }} [{{ field.unit }}]
{% endfor %}
{% if with_material %}
 * A drag_factor of 0 takes Wen & Yu's law. Results, on the particles in a unit volume: force [N m-3],
 * its derivative for the slip [N s m-4], [3 i + j] = dF_i / dslip_j, null if it is not wanted, and
 * the exchange coefficient F.slip / slip^2 [kg m-3 s-1]. */
int {{ name }}_force(const {{ name }}_library* library, const {{ name }}_material* material,
    const double* inputs, {{ name }}_guard* guard, double* force, double* derivative,
    double* exchange);
{% else %}
 * gradient: derivatives for them, null if they are not wanted. */
int {{ name }}_physical(const {{ name }}_library* library, const double* inputs,
    {{ name }}_guard* guard, double* answer, double* gradient);
{% endif %}

#ifdef __cplusplus
}
#endif

#endif
