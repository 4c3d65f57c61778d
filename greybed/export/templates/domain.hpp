{# Whether features lie in the training data, and the nearest place that does. #}
constexpr int N_FEATURES = {{ n_features }};
constexpr int BLOCKS = {{ columns // 4 }};
constexpr int N_COLUMNS = {{ columns }};

/// Precision times the way from the centre of the training data, and the squared distance.
GREYBED_DEVICE inline double distance2(const double* features, double* away, double* across) {
  Sums<BLOCKS> sums;
  sums.set(0.0);
  for (int i = 0; i < N_FEATURES; ++i) {
    away[i] = features[i] - domain_centre()[i];
    sums.add(domain_precision() + N_COLUMNS * i, eight(away[i]));
  }
  sums.put(across);
  double sum = 0.0;
  for (int i = 0; i < N_FEATURES; ++i) sum += across[i] * away[i];
  return sum;
}

/// Whether features lie outside the training data.
GREYBED_DEVICE inline bool outside(const double* features) {
  int box = 0;  // without branches
  for (int i = 0; i < N_FEATURES; ++i) {
    box |= static_cast<int>(features[i] < domain_low()[i]);
    box |= static_cast<int>(features[i] > domain_high()[i]);
  }
  double away[N_FEATURES];
  double across[N_COLUMNS];
  return distance2(features, away, across) > {{ limit2 }} || box != 0;
}

/// A place inside the training data: held at the box, then drawn towards the centre.
struct Inner {
  double features[N_FEATURES];
  double away[N_FEATURES];
  double across[N_COLUMNS];
  bool held[N_FEATURES];
  double square;  // distance before it was drawn in
  double part;    // of the way from the centre

  GREYBED_DEVICE explicit Inner(const double* f) : square(0.0), part(1.0) {
    for (int i = 0; i < N_FEATURES; ++i) {
      const double low = domain_low()[i];
      const double high = domain_high()[i];
      features[i] = f[i] < low ? low : (f[i] > high ? high : f[i]);
      held[i] = f[i] < low || f[i] > high;
    }
    square = distance2(features, away, across);
    if (square > {{ limit2 }}) {
      part = std::sqrt({{ limit2 }} / square);
      for (int i = 0; i < N_FEATURES; ++i) features[i] = domain_centre()[i] + part * away[i];
    }
  }

  /// A gradient at the place inside becomes one at the place where it came from.
  GREYBED_DEVICE void back(double* gradient) const {
    double along = 0.0;
    for (int i = 0; i < N_FEATURES; ++i) along += gradient[i] * away[i];
    for (int i = 0; i < N_FEATURES; ++i) {
      if (part < 1.0) gradient[i] = part * (gradient[i] - along * across[i] / square);
      if (held[i]) gradient[i] = 0.0;
    }
  }
};

