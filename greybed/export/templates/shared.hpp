{# What all exported closures share; a program that includes several of them has it once. #}
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
{% if kind == "mlp" %}
// Programs for any x86-64 processor take the way of AVX2 through networks where the processor has it.
#if defined(__x86_64__) && defined(__SSE2__) && !defined(__AVX2__) && !defined(GREYBED_AVX2) && \
    !defined(GREYBED_NO_DISPATCH) && !defined(__CUDA__) && !defined(__CUDACC__) && !defined(__HIPCC__)
#if defined(__clang__)
#if __clang_major__ >= 9
#define GREYBED_DISPATCHES 1
#endif
#elif defined(__GNUC__)
#if __GNUC__ >= 8
#define GREYBED_DISPATCHES 1
#endif
#endif
#endif
{% endif %}
#if defined(__AVX__) || defined(GREYBED_DISPATCHES)
#include <immintrin.h>
#elif defined(__SSE2__)
#include <emmintrin.h>
#endif

// Functions and constants stay inside the library that they are compiled into: two plug-ins with
// closures of one name, but other weights, would share them else. Types may cross.
#if (defined(__clang__) || defined(__GNUC__)) && !defined(_WIN32) && !defined(__CUDACC__)
#define GREYBED_HIDES 1
#define GREYBED_TYPE __attribute__((visibility("default")))
#pragma GCC visibility push(hidden)
#else
#define GREYBED_TYPE
#endif

#ifndef GREYBED_SHARED_3
#define GREYBED_SHARED_3

// Functions that a graphics processor can run as well; define it yourself for other compilers.
#ifndef GREYBED_DEVICE
#if defined(__CUDA__) || defined(__CUDACC__) || defined(__HIPCC__)
#define GREYBED_DEVICE __attribute__((host)) __attribute__((device))
#else
#define GREYBED_DEVICE
#endif
#endif
#ifndef GREYBED_HOT
#if defined(__clang__) || defined(__GNUC__)
#define GREYBED_HOT GREYBED_DEVICE inline __attribute__((always_inline))
#else
#define GREYBED_HOT GREYBED_DEVICE inline
#endif
#endif

namespace greybed {

/// What a guarded call does outside of the training data, or of the range of a marker.
enum class GREYBED_TYPE Policy {
  clamp,  ///< the closure at the nearest place that it knows
  baseline,  ///< exactly the law without the learnt part
  abort,     ///< nothing: results are NaN, and the host is to stop
  extrapolate  ///< the closure as it is, and the count
};

/// What a guarded call did.
enum class GREYBED_TYPE Status {
  inside = 0,    ///< the closure as it is
  clamped = 1,   ///< outside, policy clamp
  baseline = 2,  ///< outside, policy baseline
  refused = 3,   ///< outside, policy abort; or a number that makes no sense: results are NaN
  extrapolated = 4  ///< outside, policy extrapolate
};

/// Policy and counts. The host owns it, one for each thread, and sums them up with add.
struct GREYBED_TYPE Guard {
  Policy policy;
  std::uint64_t calls;
  std::uint64_t outside;  ///< calls outside, whatever was done
  std::uint64_t invalid;  ///< calls with a number that is not finite or makes no sense

  GREYBED_DEVICE explicit Guard(Policy chosen = Policy::baseline)
      : policy(chosen), calls(0), outside(0), invalid(0) {}

  GREYBED_DEVICE void add(const Guard& other) {
    calls += other.calls;
    outside += other.outside;
    invalid += other.invalid;
  }
};

namespace shared3 {

GREYBED_DEVICE inline std::uint64_t as_bits(double v) {
  std::uint64_t bits;
  std::memcpy(&bits, &v, sizeof bits);
  return bits;
}
inline std::uint64_t as_bits(float v) {
  std::uint32_t bits;
  std::memcpy(&bits, &v, sizeof bits);
  return bits;
}
inline std::uint64_t as_bits(std::int32_t v) {
  return static_cast<std::uint64_t>(static_cast<std::int64_t>(v));
}
inline std::uint64_t as_bits(std::int8_t v) {
  return static_cast<std::uint64_t>(static_cast<std::int64_t>(v));
}

/// Checksum of an array, after the one before it.
template <class T>
inline std::uint64_t fnv(std::uint64_t value, const T* data, std::size_t n) {
  for (std::size_t k = 0; k < n; ++k) value = (value ^ as_bits(data[k])) * 0x100000001b3ULL;
  return value;
}

/// From the bits, for -ffast-math believes that every number is finite.
GREYBED_DEVICE inline bool is_finite(const double* v) {
  std::uint64_t bits;
  std::memcpy(&bits, v, sizeof bits);
  return (bits & 0x7ff0000000000000ULL) != 0x7ff0000000000000ULL;
}

GREYBED_DEVICE inline double not_a_number() {
  const std::uint64_t bits = 0x7ff8000000000000ULL;
  double v;
  std::memcpy(&v, &bits, sizeof v);
  return v;
}

/// To the tolerance of golden rows; a number that is not finite is close to nothing.
inline bool close(double value, double expected) {
  const double size = expected < 0.0 ? -expected : expected;
  const double error = value < expected ? expected - value : value - expected;
  return is_finite(&value) && error <= {{ tolerance }} * size;
}

/// 1 / (1 + e^-x) without overflow.
GREYBED_DEVICE inline double logistic(double x) {
  const double e = std::exp(x < 0.0 ? x : -x);
  return (x < 0.0 ? e : 1.0) / (1.0 + e);
}

{% include "lanes.hpp" %}

{% include "bends.hpp" %}

{% include "layers.hpp" %}

{% include "dual.hpp" %}

}  // namespace shared3
}  // namespace greybed
#endif  // GREYBED_SHARED_3
{% if kind == "mlp" %}
#if defined(GREYBED_DISPATCHES) && !defined(GREYBED_SHARED_3_AVX2)
#define GREYBED_SHARED_3_AVX2 1
// The same for processors with AVX2 and FMA, inside a program that was compiled for any.
#define GREYBED_AVX2 1
#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2,fma"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2,fma")
#endif
namespace greybed {
namespace shared3 {
namespace avx2 {
{% include "lanes.hpp" %}

{% include "bends.hpp" %}

{% include "layers.hpp" %}
}  // namespace avx2
}  // namespace shared3
}  // namespace greybed
#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif
#undef GREYBED_AVX2
#undef GREYBED_WIDE

namespace greybed {
namespace shared3 {
/// Whether this processor, and its system, has them.
inline bool has_avx2() {
  return __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0;
}
}  // namespace shared3
}  // namespace greybed
#endif

{% endif %}
