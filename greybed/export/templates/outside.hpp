{# Whether features lie in the training data. #}
/// Whether features lie outside the training data.
inline bool outside(const double* features) {
  bool box = false;
  double distance2 = 0.0;
  for (int i = 0; i < {{ features|length }}; ++i) {
    box = box || features[i] < domain_low()[i] || features[i] > domain_high()[i];
    double row = 0.0;
    for (int k = 0; k < {{ features|length }}; ++k) {
      row += domain_precision()[{{ features|length }} * i + k] * (features[k] - domain_centre()[k]);
    }
    distance2 += row * (features[i] - domain_centre()[i]);
  }
  return box || distance2 > {{ limit2 }};
}
