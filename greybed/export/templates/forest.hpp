{# A forest: the mean of its leaves. #}
/// Forest: mean leaf values. Features are compared in single precision, as they were trained.
inline void predictor(const double* features, double* raw) {
  float single[{{ features|length }}];
  for (int k = 0; k < {{ features|length }}; ++k) single[k] = static_cast<float>(features[k]);
  const std::int8_t* const which = feature();
  const float* const cut = threshold();
  const std::int32_t* const next = following();  // left child, or row of a leaf's values
  for (int k = 0; k < {{ outputs }}; ++k) raw[k] = 0.0;
  for (int tree = 0; tree < {{ n_trees }}; ++tree) {
    std::int32_t node = roots()[tree];
    while (which[node] >= 0) node = next[node] + (single[which[node]] > cut[node] ? 1 : 0);
    const double* const leaf = leaf_values() + {{ outputs }} * static_cast<std::ptrdiff_t>(next[node]);
    for (int k = 0; k < {{ outputs }}; ++k) raw[k] += leaf[k];
  }
  for (int k = 0; k < {{ outputs }}; ++k) raw[k] /= {{ n_trees }}.0;
}
