// Self-test of {{ name }}.hpp; with the word rows it also evaluates CSV rows from stdin.
// SPDX-License-Identifier: {{ licence }}
//
//   {{ name }}_test                    says name, hash and self-test; exit code 1 if that fails
//   {{ name }}_test rows < in.csv      header line of marker names, then numbers, to
//                                      {{ quantity.output }},stderr,extrapolates
#include "{{ name }}.hpp"

#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace closure = greybed::{{ name }};

static int evaluate_rows() {
  static char line[4096];
  if (std::fgets(line, sizeof line, stdin) == NULL) line[0] = '\0';
  line[std::strcspn(line, "\r\n")] = '\0';
  if (std::strcmp(line, closure::markers()) != 0) {
    std::fprintf(stderr, "the first line must be %s\n", closure::markers());
    return 2;
  }
  std::printf("{{ quantity.output }},stderr,extrapolates\n");
  for (long row = 1; std::fgets(line, sizeof line, stdin) != NULL; ++row) {
    double marker[{{ markers|length }}];
    char* at = line;
    for (int k = 0; k < {{ markers|length }}; ++k) {
      char* end = at;
      marker[k] = std::strtod(at, &end);
      if (end == at) {
        std::fprintf(stderr, "row %ld: {{ markers|length }} numbers are needed\n", row);
        return 2;
      }
      at = *end == ',' ? end + 1 : end;
    }
    double factor;
    double error;
    bool extrapolates;
    closure::predict({% for marker in markers %}marker[{{ loop.index0 }}], {% endfor %}factor, error, extrapolates);
    std::printf("%.17g,%.17g,%d\n", factor, error, extrapolates ? 1 : 0);
  }
  return 0;
}

int main(int count, char** words) {
  if (count > 1 && std::strcmp(words[1], "rows") == 0) return evaluate_rows();
  const int failing = closure::self_test();
  std::printf("name %s\nhash %s\nmarkers %s\n", closure::name(), closure::hash(),
              closure::markers());
  std::printf("failing %d of {{ rows }} golden rows\n", failing);
  return failing == 0 ? 0 : 1;
}
