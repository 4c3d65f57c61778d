// Self-test of {{ name }}.hpp; it also evaluates CSV rows from stdin, and says how fast it is.
// SPDX-License-Identifier: {{ facts.licence }}
//
//   {{ name }}_test                     says name, hash and self-test; exit code 1 if that fails
//   {{ name }}_test rows < in.csv       header line of marker names, then numbers, to
//                                       {{ outputs|join(",") }},extrapolates
//   {{ name }}_test grad < in.csv       the same markers, to answers and their derivatives
//   {{ name }}_test guarded POLICY < in.csv   {{ n_inputs }} physical numbers a line; POLICY is clamp,
//                                       baseline, abort or extrapolate; to answers, derivatives, status; the
//                                       last line counts calls, outside, invalid
//   {{ name }}_test time                nanoseconds of a value, and of a value with derivatives
#include "{{ name }}.hpp"

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace closure = greybed::{{ name }};

static bool read_numbers(char* at, int n, double* out) {
  for (int k = 0; k < n; ++k) {
    char* end = at;
    out[k] = std::strtod(at, &end);
    if (end == at) return false;
    at = *end == ',' ? end + 1 : end;
  }
  return true;
}

static void say(const double* numbers, int n) {
  for (int k = 0; k < n; ++k) std::printf("%.17g,", numbers[k]);
}

static const int n_markers = {{ markers|length }};
static const int n_answers = {{ n_answers }};
static const int n_inputs = {{ n_inputs }};

{% set args %}{% for marker in markers %}m[{{ loop.index0 }}]{{ ", " if not loop.last }}{% endfor %}{% endset %}
static int evaluate_rows(bool slopes) {
  static char line[4096];
  if (std::fgets(line, sizeof line, stdin) == nullptr) line[0] = '\0';
  line[std::strcspn(line, "\r\n")] = '\0';
  if (std::strcmp(line, closure::markers()) != 0) {
    std::fprintf(stderr, "the first line must be %s\n", closure::markers());
    return 2;
  }
  std::printf("%s,extrapolates\n", closure::outputs());
  for (long row = 1; std::fgets(line, sizeof line, stdin) != nullptr; ++row) {
    double m[n_markers];
    if (!read_numbers(line, n_markers, m)) {
      std::fprintf(stderr, "row %ld: %d numbers are needed\n", row, n_markers);
      return 2;
    }
    double answers[{{ [outputs|length, n_answers]|max }}];
    bool extrapolates = false;
    if (slopes) {
      double gradient[n_answers * n_markers];
{% if n_answers > 1 %}
      closure::eval_grad({{ args }}, answers, gradient);
{% else %}
      answers[0] = closure::eval_grad({{ args }}, gradient);
{% endif %}
      say(answers, n_answers);
      say(gradient, n_answers * n_markers);
    } else {
      closure::predict({{ args }}, {% for _ in outputs %}answers[{{ loop.index0 }}], {% endfor %}extrapolates);
      say(answers, {{ outputs|length }});
    }
    std::printf("%d\n", extrapolates ? 1 : 0);
  }
  return 0;
}

/// Physical numbers to answers and derivatives under a guard.
static closure::Outputs guarded(const double* x, bool slopes, greybed::Guard& guard, int& status) {
  closure::Outputs out = closure::Outputs();
  closure::Inputs in;
{% if with_material %}
  const closure::Material m = closure::material(x[0], x[1], x[2], x[3], x + 4);
  in.solid_fraction = x[7];
  std::memcpy(in.gas_velocity_m_s, x + 8, 3 * sizeof(double));
  std::memset(in.particle_velocity_m_s, 0, 3 * sizeof(double));
  std::memcpy(in.pressure_gradient_pa_m, x + 11, 3 * sizeof(double));
  in.filter_size_m = x[14];
  in.parcels = x[17];
  const closure::Law law = {x[15], x[16]};
  status = static_cast<int>(slopes ? closure::eval_grad(m, in, law, guard, out) : closure::eval(m, in, law, guard, out));
{% else %}
{% for field in inputs %}
  in.{{ field.name }} = x[{{ loop.index0 }}];
{% endfor %}
  status = static_cast<int>(slopes ? closure::eval_grad(in, guard, out) : closure::eval(in, guard, out));
{% endif %}
  return out;
}

static int evaluate_guarded(const char* policy) {
  greybed::Guard guard(std::strcmp(policy, "clamp") == 0      ? greybed::Policy::clamp
                       : std::strcmp(policy, "baseline") == 0 ? greybed::Policy::baseline
                       : std::strcmp(policy, "abort") == 0    ? greybed::Policy::abort
                                                              : greybed::Policy::extrapolate);
  static char line[4096];
  for (long row = 1; std::fgets(line, sizeof line, stdin) != nullptr; ++row) {
    double x[n_inputs];
    if (!read_numbers(line, n_inputs, x)) {
      std::fprintf(stderr, "row %ld: %d numbers are needed\n", row, n_inputs);
      return 2;
    }
    int status = 0;
    const closure::Outputs out = guarded(x, true, guard, status);
{% if with_material %}
    say(out.force_n_m3, 3);
    say(out.derivative_n_s_m4, 9);
    say(&out.exchange_kg_m3_s, 1);
{% else %}
    say(&out.{{ outputs[0] }}, 1);
    say(out.gradient, n_inputs);
{% endif %}
    std::printf("%d\n", status);
  }
  std::printf("%llu,%llu,%llu\n", static_cast<unsigned long long>(guard.calls),
              static_cast<unsigned long long>(guard.outside),
              static_cast<unsigned long long>(guard.invalid));
  return 0;
}

static double time_of(bool slopes) {
  const long n = 2000;  // many short turns, for other programs interrupt long ones
  double best = 1e300;
  static volatile double kept;
  for (int turn = 0; turn < 200; ++turn) {
    double sum = 0.0;
{% if with_material %}
    const double gravity[3] = {0.0, -9.81, 0.0};
    const closure::Material material = closure::material(75e-6, 1500.0, 1.3, 1.8e-5, gravity);
    greybed::Guard guard(greybed::Policy::clamp);
    closure::Law law;  // of the host, and not counted
    law.factor = closure::wen_yu(0.2, 2.0, &law.steep);
{% endif %}
    const std::chrono::steady_clock::time_point begin = std::chrono::steady_clock::now();
    for (long k = 0; k < n; ++k) {
      const double part = static_cast<double>(k % 1000) / 1000.0;
{% if with_material %}
      const closure::Inputs in = {
          0.02 + 0.5 * part, {0.1 * part, 0.2 + 0.3 * part, 0.05}, {0.0, 0.0, 0.0},
          {100.0 * part, -3000.0, 20.0}, 3e-3, 1.0};
      closure::Outputs out;
      if (slopes) {
        closure::eval_grad(material, in, law, guard, out);
        sum += out.derivative_n_s_m4[4];
      } else {
        closure::eval(material, in, law, guard, out);
      }
      sum += out.force_n_m3[1];
{% else %}
      const double* const row = closure::detail::golden_markers() + n_markers * (k % {{ rows }});
      double m[n_markers];
      for (int i = 0; i < n_markers; ++i) m[i] = row[i];
      m[0] *= 1.0 - 1e-9 * part;
      if (slopes) {
        double gradient[n_markers];
        sum += closure::eval_grad({{ args }}, gradient) + gradient[0];
      } else {
        sum += closure::eval({{ args }});
      }
{% endif %}
    }
    const std::chrono::duration<double, std::nano> passed = std::chrono::steady_clock::now() - begin;
    const double each = passed.count() / static_cast<double>(n);
    best = each < best ? each : best;
    kept = sum;
  }
  (void)kept;
  return best;
}

int main(int count, char** words) {
  if (count > 1 && std::strcmp(words[1], "rows") == 0) return evaluate_rows(false);
  if (count > 1 && std::strcmp(words[1], "grad") == 0) return evaluate_rows(true);
  if (count > 2 && std::strcmp(words[1], "guarded") == 0) return evaluate_guarded(words[2]);
  if (count > 1 && std::strcmp(words[1], "time") == 0) {
    std::printf("value %.1f ns\nderivative %.1f ns\n", time_of(false), time_of(true));
    return 0;
  }
  const int failing = closure::self_test();
  std::printf("name %s\nhash %s\nmarkers %s\noutputs %s\n", closure::name(), closure::hash(),
              closure::markers(), closure::outputs());
  std::printf("failing %d of {{ rows }} golden rows\n", failing);
  return failing == 0 ? 0 : 1;
}
