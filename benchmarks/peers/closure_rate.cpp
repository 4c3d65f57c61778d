// Seconds per pair of an exported closure: rows of float64 markers in, times on one thread out.
//
// Build: g++ -std=c++11 -O3 -march=native -DCLOSURE_HEADER='"X.hpp"' -DCLOSURE=greybed::X closure_rate.cpp
// Run:   closure_rate rows.bin RUNS factors.bin     int32 n, then four columns of n float64
#include CLOSURE_HEADER

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>

int main(int argc, char **argv) {
  if (argc != 4) return 2;
  std::FILE *f = std::fopen(argv[1], "rb");
  std::int32_t n = 0;
  if (!f || std::fread(&n, 4, 1, f) != 1) return 2;
  std::vector<double> in(4 * static_cast<std::size_t>(n)), out(n);
  if (std::fread(in.data(), 8, in.size(), f) != in.size()) return 2;
  std::fclose(f);
  const double *a = in.data(), *b = a + n, *c = b + n, *d = c + n;
  typedef std::chrono::steady_clock clock;
  // In pieces, each the best of its runs: other programs interrupt long ones.
  const int piece = 1024;
  double single = 0.0, batch = 0.0;
  for (int first = 0; first < n; first += piece) {
    const int last = first + piece < n ? first + piece : n;
    double one = 1e300, many = 1e300;
    for (int run = 0; run < std::atoi(argv[2]); run++) {
      clock::time_point t = clock::now();
      for (int k = first; k < last; k++) out[k] = CLOSURE::eval(a[k], b[k], c[k], d[k]);
      double s = std::chrono::duration<double>(clock::now() - t).count();
      one = s < one ? s : one;
      t = clock::now();
      CLOSURE::eval_batch(last - first, a + first, b + first, c + first, d + first, out.data() + first);
      s = std::chrono::duration<double>(clock::now() - t).count();
      many = s < many ? s : many;
    }
    single += one / n;
    batch += many / n;
  }
  std::printf("{\"single\": %.4e, \"batch\": %.4e, \"sound\": %d}\n", single, batch, CLOSURE::self_test() == 0);
  f = std::fopen(argv[3], "wb");
  std::fwrite(out.data(), 8, n, f);
  std::fclose(f);
}
