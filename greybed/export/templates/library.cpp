// C interface of {{ name }}.hpp, which stands in here for several processors; open takes the best.
// SPDX-License-Identifier: {{ facts.licence }}
//
// g++ -std=c++11 -O3 -fPIC -shared {{ name }}_c.cpp -o lib{{ name }}.so
#include "{{ name }}_c.h"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
// Dispatch by hand rather than by target_clones: those see only loops that the compiler turns into
// vectors, while the header, compiled for a processor, has its vectors written out.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__AVX2__) && !defined(GREYBED_NO_DISPATCH)
#define GREYBED_DISPATCH 1
#include <immintrin.h>
#endif

{% set kinds = ["default"] if kind == "forest" else ["avx2", "default"] %}
struct {{ name }}_library {
  const char* target;
  int (*self_test)();
  void (*eval)(const double*, double*);
  void (*eval_grad)(const double*, double*, double*);
  void (*eval_batch)(std::size_t, const double*, double*);
  bool (*predict)(const double*, double*);
  bool (*in_domain)(const double*);
{% if with_material %}
  void (*make_material)(const double*, {{ name }}_material*);
  int (*force)(const {{ name }}_material*, const double*, {{ name }}_guard*, double*, double*, double*);
{% else %}
  int (*physical)(const double*, {{ name }}_guard*, double*, double*);
{% endif %}
};

{% set args %}{% for marker in markers %}m[{{ loop.index0 }}]{{ ", " if not loop.last }}{% endfor %}{% endset %}
{% for target in kinds %}
{% if target == "avx2" %}
#ifdef GREYBED_DISPATCH
#define greybed greybed_avx2
#define GREYBED_AVX2 1
#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2,fma"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2,fma")
#endif
{% endif %}
#include "{{ name }}.hpp"

namespace for_{{ target }} {
namespace {

namespace closure = greybed::{{ name }};

void eval(const double* m, double* answers) {
{% if n_answers > 1 %}
  closure::eval({{ args }}, answers);
{% else %}
  answers[0] = closure::eval({{ args }});
{% endif %}
}

void eval_grad(const double* m, double* answers, double* gradient) {
{% if n_answers > 1 %}
  closure::eval_grad({{ args }}, answers, gradient);
{% else %}
  answers[0] = closure::eval_grad({{ args }}, gradient);
{% endif %}
}

void eval_batch(std::size_t n, const double* m, double* answers) {
  for (std::size_t k = 0; k < n; ++k, m += {{ markers|length }}, answers += {{ n_answers }}) eval(m, answers);
}

bool predict(const double* m, double* outputs) {
  bool extrapolates = false;
  closure::predict({{ args }}, {% for _ in outputs %}outputs[{{ loop.index0 }}], {% endfor %}extrapolates);
  return extrapolates;
}

bool in_domain(const double* m) { return closure::in_domain({{ args }}); }

greybed::Guard guard_of(const {{ name }}_guard* given) {
  greybed::Guard guard(static_cast<greybed::Policy>(static_cast<int>(given->policy)));
  guard.calls = given->calls;
  guard.outside = given->outside;
  guard.invalid = given->invalid;
  return guard;
}

void give_back(const greybed::Guard& guard, {{ name }}_guard* given) {
  given->calls = guard.calls;
  given->outside = guard.outside;
  given->invalid = guard.invalid;
}

{% if with_material %}
static_assert(sizeof({{ name }}_material) == sizeof(closure::Material), "numbers of a material");

void make_material(const double* x, {{ name }}_material* out) {
  const closure::Material m = closure::material(x[0], x[1], x[2], x[3], x + 4);
  std::memcpy(out->numbers, &m, sizeof m);
}

int force(const {{ name }}_material* material, const double* x, {{ name }}_guard* given, double* force,
          double* derivative, double* exchange) {
  closure::Material m;
  std::memcpy(&m, material->numbers, sizeof m);
  closure::Inputs in = {x[0], {x[1], x[2], x[3]}, {0.0, 0.0, 0.0}, {x[4], x[5], x[6]}, x[7], x[10]};
  closure::Law law = {x[8], x[9]};
  if (!(law.factor > 0.0)) law = closure::detail::wen_yu_at(m, in);
  greybed::Guard guard = guard_of(given);
  closure::Outputs out;
  const greybed::Status status = derivative != nullptr ? closure::eval_grad(m, in, law, guard, out)
                                                       : closure::eval(m, in, law, guard, out);
  give_back(guard, given);
  std::memcpy(force, out.force_n_m3, sizeof out.force_n_m3);
  if (derivative != nullptr) std::memcpy(derivative, out.derivative_n_s_m4, sizeof out.derivative_n_s_m4);
  *exchange = out.exchange_kg_m3_s;
  return static_cast<int>(status);
}
{% else %}
int physical(const double* x, {{ name }}_guard* given, double* answer, double* gradient) {
  const closure::Inputs in = { {%- for _ in flat %}x[{{ loop.index0 }}]{{ ", " if not loop.last }}{% endfor -%} };
  greybed::Guard guard = guard_of(given);
  closure::Outputs out;
  const greybed::Status status =
      gradient != nullptr ? closure::eval_grad(in, guard, out) : closure::eval(in, guard, out);
  give_back(guard, given);
  *answer = out.{{ outputs[0] }};
  if (gradient != nullptr) std::memcpy(gradient, out.gradient, sizeof out.gradient);
  return static_cast<int>(status);
}
{% endif %}

const {{ name }}_library library = {
    "{{ target }}", closure::self_test, eval, eval_grad, eval_batch, predict, in_domain,
    {{ "make_material, force" if with_material else "physical" }}};

}  // namespace
}  // namespace for_{{ target }}
{% if target == "avx2" %}
#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif
#undef greybed
#undef GREYBED_AVX2
#undef GREYBED_VECTORS
#undef GREYBED_WIDE
#undef GREYBED_SHARED_3
#undef {{ guard }}
#define GREYBED_NO_DISPATCH 1
#endif  // GREYBED_DISPATCH
{% endif %}

{% endfor %}
namespace closure = greybed::{{ name }};

extern "C" {

int {{ name }}_abi(void) { return {{ name|upper }}_ABI; }
{% for fact in ["name", "version", "hash", "dataset_hash", "licence", "citation", "markers", "outputs"] %}
const char* {{ name }}_{{ fact }}(void) { return closure::{{ fact }}(); }
{% endfor %}

const {{ name }}_library* {{ name }}_open(int abi, char* message, std::size_t size) {
  if (abi != {{ name|upper }}_ABI) {
    std::snprintf(message, size,
                  "{{ name }}: the host was compiled for interface %d, this library has %d; compile "
                  "the host with the header of this library.",
                  abi, {{ name|upper }}_ABI);
    return nullptr;
  }
  const {{ name }}_library* library = &for_default::library;
{% if "avx2" in kinds %}
#ifdef GREYBED_DISPATCH
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) library = &for_avx2::library;
#endif
{% endif %}
  const int failing = library->self_test();
  if (failing != 0) {
    std::snprintf(message, size,
                  "{{ name }}: %d of {{ rows }} golden rows and the checksum fail (hash %s, built for "
                  "%s); this build computes wrongly and does not serve: compile it again with other "
                  "flags or another compiler.",
                  failing, closure::hash(), library->target);
    return nullptr;
  }
  if (size > 0) message[0] = '\0';
  return library;
}

const char* {{ name }}_target(const {{ name }}_library* library) {
  return library == nullptr ? "" : library->target;
}

int {{ name }}_eval(const {{ name }}_library* library, const double* markers, double* answers) {
  if (library == nullptr) return {{ name|upper }}_NOT_OPEN;
  library->eval(markers, answers);
  return 0;
}

int {{ name }}_eval_grad(const {{ name }}_library* library, const double* markers, double* answers,
    double* gradient) {
  if (library == nullptr) return {{ name|upper }}_NOT_OPEN;
  library->eval_grad(markers, answers, gradient);
  return 0;
}

int {{ name }}_eval_batch(const {{ name }}_library* library, std::size_t n, const double* markers,
    double* answers) {
  if (library == nullptr) return {{ name|upper }}_NOT_OPEN;
  library->eval_batch(n, markers, answers);
  return 0;
}

int {{ name }}_predict(const {{ name }}_library* library, const double* markers, double* outputs,
    int* extrapolates) {
  if (library == nullptr) return {{ name|upper }}_NOT_OPEN;
  *extrapolates = library->predict(markers, outputs) ? 1 : 0;
  return 0;
}

int {{ name }}_in_domain(const {{ name }}_library* library, const double* markers) {
  if (library == nullptr) return {{ name|upper }}_NOT_OPEN;
  return library->in_domain(markers) ? 1 : 0;
}

{% if with_material %}
int {{ name }}_make_material(const {{ name }}_library* library, double diameter_m,
    double particle_density_kg_m3, double gas_density_kg_m3, double gas_viscosity_pa_s,
    const double* gravity_m_s2, {{ name }}_material* material) {
  if (library == nullptr) return {{ name|upper }}_NOT_OPEN;
  const double numbers[7] = {diameter_m, particle_density_kg_m3, gas_density_kg_m3,
      gas_viscosity_pa_s, gravity_m_s2[0], gravity_m_s2[1], gravity_m_s2[2]};
  library->make_material(numbers, material);
  return 0;
}

int {{ name }}_force(const {{ name }}_library* library, const {{ name }}_material* material,
    const double* inputs, {{ name }}_guard* guard, double* force, double* derivative,
    double* exchange) {
  if (library == nullptr) return {{ name|upper }}_NOT_OPEN;
  return library->force(material, inputs, guard, force, derivative, exchange);
}
{% else %}
int {{ name }}_physical(const {{ name }}_library* library, const double* inputs,
    {{ name }}_guard* guard, double* answer, double* gradient) {
  if (library == nullptr) return {{ name|upper }}_NOT_OPEN;
  return library->physical(inputs, guard, answer, gradient);
}
{% endif %}

}  // extern "C"
