// Embree 3's rate on native sphere primitives: closest hits of cosine-law rays in an open packing.
//
// Input: int32 n, then n x float32 (x, y, z, r).
// Build: g++ -O3 -march=native embree_rate.cpp -lembree3 -lpthread   (Debian: libembree-dev)
// Run:   embree_rate packing.bin RAYS_PER_SPHERE THREADS WIDTH
//        WIDTH 1, 4, 8 or 16: rays per call (rtcIntersect1, 4, 8, 16); 0: a stream (rtcIntersect1M)
//   or   embree_rate packing.bin rays.bin hits.bin
//        int32 emitter and 6 float32 (origin, direction) a ray in, int32 sphere (-1: none) out
//
// What is done for Embree: build quality HIGH, incoherent rays, no robust mode, denormals flushed as
// its manual asks, one packet call for many rays where asked. Rays are made as cheaply as in greybed
// (no sine, no cosine). It only counts the hits; greybed also counts every pair.
#include <embree3/rtcore.h>
#include <pmmintrin.h>
#include <xmmintrin.h>

#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <thread>
#include <vector>

static inline uint64_t next(uint64_t &s) {
  uint64_t z = (s += 0x9E3779B97F4A7C15ull);
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
  return z ^ (z >> 31);
}

// Uniform point of the unit disc; one 64-bit number gives both coordinates.
static inline void disc(uint64_t &s, float &x, float &y, float &q) {
  do {
    const uint64_t z = next(s);
    x = float(int32_t(z >> 32)) * 0x1p-31f;
    y = float(int32_t(z)) * 0x1p-31f;
    q = x * x + y * y;
  } while (q >= 1.0f);
}

struct Ray { float o[3], d[3], r; };

// Isotropic direction, uniform point of the disc across it: the cosine law of a Lambertian sphere.
static inline Ray emit(uint64_t &s, const float *p) {
  float x, y, q, u, v, e;
  disc(s, x, y, q);
  const float w = 2.0f * sqrtf(1.0f - q), dx = x * w, dy = y * w, dz = 1.0f - 2.0f * q;
  disc(s, u, v, e);
  const float sign = copysignf(1.0f, dz), a = -1.0f / (sign + dz), b = dx * dy * a;
  const float lift = sqrtf(1.0f - e), R = p[3];
  const float px = u * (1.0f + sign * dx * dx * a) + v * b + lift * dx;
  const float py = u * (sign * b) + v * (sign + dy * dy * a) + lift * dy;
  const float pz = u * (-sign * dx) - v * dy + lift * dz;
  return {{p[0] + R * px, p[1] + R * py, p[2] + R * pz}, {dx, dy, dz}, R};
}

static inline RTCIntersectContext context() {
  RTCIntersectContext c;
  rtcInitIntersectContext(&c);
  c.flags = RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
  return c;
}

static inline RTCRayHit single(const Ray &g) {
  RTCRayHit h;
  h.ray.org_x = g.o[0]; h.ray.org_y = g.o[1]; h.ray.org_z = g.o[2];
  h.ray.dir_x = g.d[0]; h.ray.dir_y = g.d[1]; h.ray.dir_z = g.d[2];
  h.ray.tnear = 1e-4f * g.r; h.ray.tfar = INFINITY;
  h.ray.mask = -1; h.ray.flags = 0; h.ray.time = 0.0f; h.ray.id = 0;
  h.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  h.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  return h;
}

// In float a ray may meet its own sphere just beyond tnear: it goes on behind that point.
static inline bool counts(RTCScene scene, RTCIntersectContext *c, RTCRayHit &h, unsigned self, float R) {
  if (h.hit.geomID != RTC_INVALID_GEOMETRY_ID && h.hit.primID == self) {
    h.ray.tnear = h.ray.tfar + 1e-3f * R; h.ray.tfar = INFINITY;
    h.hit.geomID = h.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(scene, c, &h);
  }
  return h.hit.geomID != RTC_INVALID_GEOMETRY_ID;
}

static long trace_single(RTCScene scene, const float *p, unsigned self, int rays, uint64_t s) {
  long hits = 0;
  for (int k = 0; k < rays; k++) {
    RTCRayHit h = single(emit(s, p));
    RTCIntersectContext c = context();
    rtcIntersect1(scene, &c, &h);
    hits += counts(scene, &c, h, self, p[3]);
  }
  return hits;
}

static long trace_stream(RTCScene scene, const float *p, unsigned self, int rays, uint64_t s) {
  constexpr int most = 256;
  static thread_local RTCRayHit h[most];
  long hits = 0;
  for (int k = 0; k < rays; k += most) {
    const int m = rays - k < most ? rays - k : most;
    for (int i = 0; i < m; i++) h[i] = single(emit(s, p));
    RTCIntersectContext c = context();
    rtcIntersect1M(scene, &c, h, m, sizeof(RTCRayHit));
    for (int i = 0; i < m; i++) hits += counts(scene, &c, h[i], self, p[3]);
  }
  return hits;
}

template <int W, class Packet, class Call>
static long trace_packet(RTCScene scene, const float *p, unsigned self, int rays, uint64_t s, Call call) {
  long hits = 0;
  alignas(64) int valid[W];
  alignas(64) Packet h;
  Ray g[W];
  for (int k = 0; k < rays; k += W) {
    for (int i = 0; i < W; i++) {
      valid[i] = k + i < rays ? -1 : 0;
      g[i] = emit(s, p);
      h.ray.org_x[i] = g[i].o[0]; h.ray.org_y[i] = g[i].o[1]; h.ray.org_z[i] = g[i].o[2];
      h.ray.dir_x[i] = g[i].d[0]; h.ray.dir_y[i] = g[i].d[1]; h.ray.dir_z[i] = g[i].d[2];
      h.ray.tnear[i] = 1e-4f * p[3]; h.ray.tfar[i] = INFINITY;
      h.ray.mask[i] = -1; h.ray.flags[i] = 0; h.ray.time[i] = 0.0f; h.ray.id[i] = 0;
      h.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
      h.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
    RTCIntersectContext c = context();
    call(valid, scene, &c, &h);
    for (int i = 0; i < W; i++) {
      if (!valid[i] || h.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) continue;
      if (h.hit.primID[i] != self) { hits++; continue; }
      RTCRayHit one = single(g[i]);
      one.ray.tfar = h.ray.tfar[i];
      one.hit.geomID = h.hit.geomID[i];
      one.hit.primID = self;
      hits += counts(scene, &c, one, self, p[3]);
    }
  }
  return hits;
}

// What given rays meet, one by one, for a comparison hit by hit.
static int write_hits(RTCScene scene, const std::vector<float> &p, const char *from, const char *to) {
  struct Given { int32_t self; float o[3], d[3]; };
  FILE *f = fopen(from, "rb"), *g = fopen(to, "wb");
  if (!f || !g) { fprintf(stderr, "cannot open %s or %s\n", from, to); return 2; }
  Given ray;
  while (fread(&ray, sizeof ray, 1, f) == 1) {
    Ray r = {{ray.o[0], ray.o[1], ray.o[2]}, {ray.d[0], ray.d[1], ray.d[2]}, p[4 * ray.self + 3]};
    RTCRayHit h = single(r);
    RTCIntersectContext c = context();
    rtcIntersect1(scene, &c, &h);
    const int32_t hit = counts(scene, &c, h, ray.self, r.r) ? int32_t(h.hit.primID) : -1;
    fwrite(&hit, 4, 1, g);
  }
  fclose(f);
  fclose(g);
  return 0;
}

int main(int argc, char **argv) {
  if (argc != 4 && argc != 5) {
    fprintf(stderr, "usage: embree_rate packing.bin RAYS THREADS WIDTH | packing.bin rays.bin hits.bin\n");
    return 2;
  }
  int n;
  FILE *f = fopen(argv[1], "rb");
  if (!f || fread(&n, 4, 1, f) != 1) { fprintf(stderr, "cannot read %s\n", argv[1]); return 2; }
  std::vector<float> p(4 * n);
  if (fread(p.data(), 16, n, f) != size_t(n)) { fprintf(stderr, "%s is cut\n", argv[1]); return 2; }
  fclose(f);
  RTCDevice device = rtcNewDevice(getenv("EMBREE_CONFIG"));
  RTCScene scene = rtcNewScene(device);
  RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_SPHERE_POINT);
  float *b = (float *)rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, 16, n);
  for (int i = 0; i < 4 * n; i++) b[i] = p[i];
  rtcSetGeometryBuildQuality(g, RTC_BUILD_QUALITY_HIGH);
  rtcCommitGeometry(g);
  rtcAttachGeometry(scene, g);
  rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
  rtcCommitScene(scene);
  if (argc == 4) return write_hits(scene, p, argv[2], argv[3]);

  const int rays = atoi(argv[2]), threads = atoi(argv[3]), width = atoi(argv[4]);
  const auto begin = std::chrono::steady_clock::now();
  std::vector<long> hits(threads, 0);
  auto work = [&](int t) {
    _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
    _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
    for (int i = t; i < n; i += threads) {
      const float *q = p.data() + 4 * i;
      uint64_t s = i * 7919ull + 1;
      s = next(s);
      if (width == 1) hits[t] += trace_single(scene, q, i, rays, s);
      if (width == 0) hits[t] += trace_stream(scene, q, i, rays, s);
      if (width == 4) hits[t] += trace_packet<4, RTCRayHit4>(scene, q, i, rays, s, rtcIntersect4);
      if (width == 8) hits[t] += trace_packet<8, RTCRayHit8>(scene, q, i, rays, s, rtcIntersect8);
      if (width == 16) hits[t] += trace_packet<16, RTCRayHit16>(scene, q, i, rays, s, rtcIntersect16);
    }
  };
  std::vector<std::thread> pool;
  for (int t = 0; t < threads; t++) pool.emplace_back(work, t);
  for (auto &t : pool) t.join();
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  long total = 0;
  for (long h : hits) total += h;
  printf("{\"version\": \"%ld.%ld.%ld\", \"width\": %d, \"mrays\": %.4f, \"hit_fraction\": %.6f}\n",
         long(rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_VERSION_MAJOR)),
         long(rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_VERSION_MINOR)),
         long(rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_VERSION_PATCH)),
         width, 1e-6 * n * double(rays) / seconds, total / (double(n) * rays));
}
