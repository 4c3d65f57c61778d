{# Whether constants are as they were written, and numbers as they should be. #}
inline std::uint64_t as_bits(double v) {
  std::uint64_t bits;
  std::memcpy(&bits, &v, sizeof bits);
  return bits;
}
{% if kind == "forest" %}
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
{% endif %}

template <class T>
inline std::uint64_t fnv(std::uint64_t value, const T* data, std::size_t n) {
  for (std::size_t k = 0; k < n; ++k) value = (value ^ as_bits(data[k])) * 0x100000001b3ULL;
  return value;
}

/// Whether every constant of this header is as it was written.
inline bool intact() {
  std::uint64_t value = 0xcbf29ce484222325ULL;
{% for table in tables %}
  value = fnv(value, {{ table.name }}(), {{ table.size }});
{% endfor %}
  return value == {{ checksum }};
}

inline bool close(double value, double expected) {
  const double size = expected < 0.0 ? -expected : expected;
  const double error = value < expected ? expected - value : value - expected;
  return error <= {{ tolerance }} * size;
}

