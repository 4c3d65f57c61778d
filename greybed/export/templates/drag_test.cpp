// Self-test of {{ name }}.hpp; it also evaluates CSV rows from stdin, and says how fast it is.
// SPDX-License-Identifier: {{ licence }}
//
//   {{ name }}_test                    says name, hash and self-test; exit code 1 if that fails
//   {{ name }}_test rows < in.csv      header line of marker names, then numbers, to
//                                      kept_along,kept_across,share,stderr,extrapolates
//   {{ name }}_test forces < in.csv    18 numbers a line: diameter, particle and gas density, gas
//                                      viscosity, gravity, solid fraction, slip, pressure gradient,
//                                      filter size, F, Re dF/dRe, parcels; to force and derivative
//   {{ name }}_test time               nanoseconds of one eval_grad
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

static int evaluate_rows() {
  static char line[4096];
  if (std::fgets(line, sizeof line, stdin) == nullptr) line[0] = '\0';
  line[std::strcspn(line, "\r\n")] = '\0';
  if (std::strcmp(line, closure::markers()) != 0) {
    std::fprintf(stderr, "the first line must be %s\n", closure::markers());
    return 2;
  }
  std::printf("kept_along,kept_across,share,stderr,extrapolates\n");
  for (long row = 1; std::fgets(line, sizeof line, stdin) != nullptr; ++row) {
    double m[{{ markers|length }}];
    if (!read_numbers(line, {{ markers|length }}, m)) {
      std::fprintf(stderr, "row %ld: {{ markers|length }} numbers are needed\n", row);
      return 2;
    }
    double along;
    double across;
    double share;
    double error;
    bool extrapolates;
    closure::predict({% for marker in markers %}m[{{ loop.index0 }}], {% endfor %}along, across, share, error, extrapolates);
    std::printf("%.17g,%.17g,%.17g,%.17g,%d\n", along, across, share, error, extrapolates ? 1 : 0);
  }
  return 0;
}

static int evaluate_forces() {
  static char line[4096];
  for (long row = 1; std::fgets(line, sizeof line, stdin) != nullptr; ++row) {
    double x[18];
    if (!read_numbers(line, 18, x)) {
      std::fprintf(stderr, "row %ld: 18 numbers are needed\n", row);
      return 2;
    }
    const closure::Material m = closure::material(x[0], x[1], x[2], x[3], x + 4);
    double force[3];
    double derivative[9];
    closure::eval_grad(m, x[7], x + 8, x + 11, x[14], x[15], x[16], x[17], force, derivative);
    for (int i = 0; i < 3; ++i) std::printf("%.17g,", force[i]);
    for (int i = 0; i < 9; ++i) std::printf(i < 8 ? "%.17g," : "%.17g\n", derivative[i]);
  }
  return 0;
}

static int time_it() {
  const double gravity[3] = {0.0, -9.81, 0.0};
  const closure::Material m = closure::material(75e-6, 1500.0, 1.3, 1.8e-5, gravity);
  const long n = 400000;
  double best = 1e300;
  double sum = 0.0;
  double steep;
  const double drag = closure::wen_yu(0.2, 2.0, &steep);  // the host's law is not counted
  for (int turn = 0; turn < 5; ++turn) {
    const std::chrono::steady_clock::time_point begin = std::chrono::steady_clock::now();
    for (long k = 0; k < n; ++k) {
      const double part = static_cast<double>(k % 1000) / 1000.0;
      const double slip[3] = {0.1 * part, 0.2 + 0.3 * part, 0.05};
      const double gradient[3] = {100.0 * part, -3000.0, 20.0};
      double force[3];
      double derivative[9];
      const double phi = 0.02 + 0.5 * part;
      closure::eval_grad(m, phi, slip, gradient, 3e-3, drag, steep, 1.0, force, derivative);
      sum += force[1] + derivative[4];
    }
    const std::chrono::duration<double, std::nano> passed =
        std::chrono::steady_clock::now() - begin;
    const double each = passed.count() / static_cast<double>(n);
    best = each < best ? each : best;
  }
  std::printf("%.1f ns (checksum %.6g)\n", best, sum);
  return 0;
}

int main(int count, char** words) {
  if (count > 1 && std::strcmp(words[1], "rows") == 0) return evaluate_rows();
  if (count > 1 && std::strcmp(words[1], "forces") == 0) return evaluate_forces();
  if (count > 1 && std::strcmp(words[1], "time") == 0) return time_it();
  const int failing = closure::self_test();
  std::printf("name %s\nhash %s\nmarkers %s\n", closure::name(), closure::hash(),
              closure::markers());
  std::printf("failing %d of {{ rows }} golden rows\n", failing);
  return failing == 0 ? 0 : 1;
}
