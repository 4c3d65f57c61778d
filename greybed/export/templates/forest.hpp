{# A forest: the mean of its leaves. #}
constexpr int N_RAW = {{ n_raw }};

/// Number k of an array that stands as bytes, lowest first.
GREYBED_HOT std::int32_t number_at(const std::int8_t* bytes, std::int32_t k) {
  const std::int8_t* const at = bytes + 4 * static_cast<std::ptrdiff_t>(k);
  std::uint32_t all = 0;
  for (int i = 3; i >= 0; --i) all = (all << 8) | static_cast<std::uint8_t>(at[i]);
  return static_cast<std::int32_t>(all);
}

/// Forest: mean leaf values. Features are compared in single precision, as they were trained.
GREYBED_DEVICE inline void forest(const double* features, double* raw) {
  float single[N_FEATURES];
  for (int k = 0; k < N_FEATURES; ++k) single[k] = static_cast<float>(features[k]);
  const std::int8_t* const which = feature();
  const float* const cut = threshold();
  const std::int8_t* const next = following();  // left child, or row of a leaf's values
  for (int k = 0; k < N_RAW; ++k) raw[k] = 0.0;
  for (int tree = 0; tree < {{ n_trees }}; ++tree) {
    std::int32_t node = roots()[tree];
    while (which[node] >= 0) node = number_at(next, node) + (single[which[node]] > cut[node] ? 1 : 0);
    const double* const leaf = leaf_values() + N_RAW * static_cast<std::ptrdiff_t>(number_at(next, node));
    for (int k = 0; k < N_RAW; ++k) raw[k] += leaf[k];
  }
  for (int k = 0; k < N_RAW; ++k) raw[k] /= {{ n_trees }}.0;
}

