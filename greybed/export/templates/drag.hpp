{# Filtered drag: kept fractions from markers. #}
{% set names = markers|map(attribute="name")|join(", ") %}
{% set typed = "double " ~ markers|map(attribute="name")|join(", double ") %}
{% set columns_in = "const double* " ~ markers|map(attribute="name")|join(", const double* ") %}
{% set of_row = markers|map(attribute="name")|join("[k], ") ~ "[k]" %}
{% set linear = outputs_raw == 4 %}
{% set values = outputs_raw - 1 %}
namespace detail {

{% include "drag_features.hpp" %}
/// What is wanted besides kept fractions and share.
enum Wanted {
  NOTHING,
  SPREAD,     // the standard error
  OF_SLIP,    // slope[k]: of ln H along, ln H across, share, for slip_up, slip_across squared,
              // gradient_work and drag_ratio
  OF_MARKERS  // slope[k]: of H along, H across, share, for each marker
};

constexpr int N_SLOPES = N_MARKERS > 4 ? N_MARKERS : 4;

struct Kept {
  double along;
  double across;
  double share;
  double stderr_;
  bool extrapolates;
  double slope[3][N_SLOPES];
};

GREYBED_DEVICE inline void nothing_kept(Kept* out, double h, double share) {
  out->along = out->across = h;
  out->share = share;
  out->stderr_ = share;
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i < N_SLOPES; ++i) out->slope[k][i] = 0.0;
  }
}

{% if kind == "mlp" %}
/// Derivatives of the network's values before their bounds, through features, for the slip.
GREYBED_DEVICE inline void slopes_of_slip(const Features& f, const double* of, double outer,
                                          double* slope) {
  slope[0] = outer * of[0] * f.bent_up;
  slope[1] = outer * of[1] * f.log_across;
{% if gradient %}
  slope[0] += outer * of[2] * f.up_of_slip;
  slope[1] += outer * of[3] * f.across_of_slip;
  slope[2] = outer * of[3] * f.across_of_work;
  slope[3] = outer * (of[2] * f.up_of_ratio + of[3] * f.across_of_ratio);
{% else %}
  slope[2] = slope[3] = 0.0;
{% endif %}
}

/// The same for each marker but the parcels.
GREYBED_DEVICE inline void slopes_of_markers(const double* m, const Features& f, const double* of,
                                             double* slope) {
  const double phi = m[0];
  slope[0] = of[0] + of[1] / (phi + {{ small.dilute }});
  slope[1] = of[2] / (m[1] + {{ small.filter }});
  slope[2] = of[3] / m[2];
  slope[3] = of[4] * f.bent_up;
  slope[4] = of[5] * f.log_across * 2.0 * m[4];
{% if gradient %}
  // q falls with solid fraction as with the ratio of drag, in proportion.
  slope[0] += (of[6] * f.up_of_ratio + of[7] * f.across_of_ratio) * m[7] / (phi + {{ small.fraction }});
  slope[3] += of[6] * f.up_of_slip;
  slope[4] += of[7] * f.across_of_slip * 2.0 * m[4];
  slope[5] = of[6] * f.up_of_pull + of[8] * f.bent_pull;
  slope[6] = of[7] * f.across_of_work;
  slope[7] = of[6] * f.up_of_ratio + of[7] * f.across_of_ratio;
{% endif %}
}

{% endif %}
/// Kept fractions of markers in their ranges; inside the training data where inner is not null.
template <int WANTED>
GREYBED_DEVICE inline void kept(const double* m, const Features& f, double g, const Inner* inner,
                                Kept* out) {
  const double* const seen = inner == nullptr ? f.value : inner->features;
  const bool all = WANTED == OF_MARKERS;
  const double parcels = {{ parcel_rate }} * (m[N_MARKERS - 1] - 1.0);
  double raw[N_RAW];
{% if kind == "mlp" %}
  double inner_slope[N_VALUES * N_COLUMNS];
  if (WANTED == OF_SLIP && inner == nullptr) {
    network<N_VALUES, 1, 1>(seen, raw, inner_slope);
  } else if (WANTED == OF_SLIP || WANTED == OF_MARKERS) {
    network<N_VALUES, 0, BLOCKS>(seen, raw, inner_slope);
  } else {
    network<(WANTED == SPREAD ? N_RAW : N_VALUES), 0, 0>(seen, raw, nullptr);
  }
  double slope[4];
  double logs[4];
  v4 bent = four(raw[0] / {{ log_bound }}, raw[1] / {{ log_bound }}, 0.0, 0.0);
  v4 bent_slope;
  squash<Bent>(bent, bent_slope);
  store(bent * four({{ log_bound }}), logs);
  store(bent_slope, slope);
  const double log_along = logs[0];
  const double log_across = logs[1];
{% else %}
  // Constant between the cuts of a forest.
  forest(seen, raw);
  const double log_along = raw[0];
  const double log_across = raw[1];
{% endif %}
  double powers[4];
{% if linear %}
  const double away = raw[2] < 0.0 ? raw[2] : -raw[2];
  store(exp_lanes(larger(four(g * (log_along - parcels), g * (log_across - parcels), away, 0.0),
                         four(-700.0))), powers);
  const double part = (raw[2] < 0.0 ? powers[2] : 1.0) / (1.0 + powers[2]);
{% if kind == "mlp" %}
  slope[2] = {{ share_bound }} * part * (1.0 - part);
{% endif %}
  const double share = {{ share_bound }} * part;
{% else %}
  store(exp_lanes(larger(four(g * (log_along - parcels), g * (log_across - parcels), 0.0, 0.0),
                         four(-700.0))), powers);
  const double share = 0.0;
{% endif %}
  out->along = powers[0];
  out->across = powers[1];
  out->share = g * share;
  out->stderr_ = 0.0;
  if (WANTED == SPREAD) {
{% if kind == "mlp" %}
    out->stderr_ = out->along * (g * ({{ spread_bound }} * logistic(raw[{{ values }}])));
{% else %}
    out->stderr_ = out->along * (g * raw[{{ values }}]);
{% endif %}
  }
  if (WANTED == OF_SLIP) {
{% if kind == "mlp" %}
    for (int k = 0; k < N_VALUES; ++k) {
      const double* of = inner_slope + 4 * k;
      if (inner != nullptr) {
        inner->back(inner_slope + N_COLUMNS * k);
        of = inner_slope + N_COLUMNS * k + 4;
      }
      slopes_of_slip(f, of, g * slope[k], out->slope[k]);
    }
{% else %}
    for (int k = 0; k < 3; ++k) {
      for (int i = 0; i < 4; ++i) out->slope[k][i] = 0.0;
    }
{% endif %}
  }
  if (all) {
    double gate_of_fraction;
    double gate_of_size;
    gate(m[0], m[1], &gate_of_fraction, &gate_of_size);
    const double value[3] = {log_along - parcels, log_across - parcels, share};
    const double outer[3] = {out->along, out->across, 1.0};
    for (int k = 0; k < 3; ++k) {
      for (int i = 0; i < N_SLOPES; ++i) out->slope[k][i] = 0.0;
{% if kind == "mlp" %}
      if (k < N_VALUES) {
        if (inner != nullptr) inner->back(inner_slope + N_COLUMNS * k);
        slopes_of_markers(m, f, inner_slope + N_COLUMNS * k, out->slope[k]);
        for (int i = 0; i < N_MARKERS - 1; ++i) out->slope[k][i] *= g * slope[k];
      }
{% endif %}
      if (k < 2) out->slope[k][N_MARKERS - 1] = -g * {{ parcel_rate }};
      out->slope[k][0] += gate_of_fraction * value[k];
      out->slope[k][1] += gate_of_size * value[k];
      for (int i = 0; i < N_MARKERS; ++i) out->slope[k][i] *= outer[k];
    }
  }
}

/// Kept fractions of any markers without a guard.
template <int WANTED>
GREYBED_DEVICE inline void freely(const double* m, Kept* out) {
  if (!in_range(m)) {
    nothing_kept(out, not_a_number(), not_a_number());
    out->extrapolates = true;
    return;
  }
  Features f;
  features_of(m, std::log(m[2]), &f);
  const double g = gate(m[0], m[1], nullptr, nullptr);
  kept<WANTED>(m, f, g, nullptr, out);
  out->extrapolates = WANTED == SPREAD && g > 0.0 && outside(f.value);
}

/// Kept fractions under a guard; log_reynolds is that of marker 2.
template <int WANTED>
GREYBED_DEVICE inline Status guarded(const double* given, double log_reynolds, Guard& guard,
                                     Kept* out) {
  ++guard.calls;
  double m[N_MARKERS];
  bool held[N_MARKERS];
  const int legal = bring_in(given, m, held);
  if (legal == 2) {
    ++guard.outside;
    ++guard.invalid;
    nothing_kept(out, not_a_number(), not_a_number());
    return Status::refused;
  }
  Features f;
  features_of(m, held[2] ? std::log(m[2]) : log_reynolds, &f);
  const double g = gate(m[0], m[1], nullptr, nullptr);
  const bool away = g > 0.0 && outside(f.value);
  if (legal == 0 && !away) {
    kept<WANTED>(m, f, g, nullptr, out);
    return Status::inside;
  }
  ++guard.outside;
  if (guard.policy == Policy::abort) {
    nothing_kept(out, not_a_number(), not_a_number());
    return Status::refused;
  }
  if (guard.policy == Policy::baseline) {
    nothing_kept(out, 1.0, 0.0);
    return Status::baseline;
  }
  if (guard.policy == Policy::extrapolate) {
    kept<WANTED>(m, f, g, nullptr, out);
    return Status::extrapolated;
  }
  const Inner inner(f.value);
  kept<WANTED>(m, f, g, &inner, out);
  return Status::clamped;
}

}  // namespace detail

/// Kept fractions, standard error of the closure (of kept_along; as much in proportion across), and
/// whether the markers lie outside its training data (never where the gate is shut).
{% filter wrapped %}
GREYBED_DEVICE inline void predict({{ typed }}, double& kept_along, double& kept_across, double& share, double& stderr_, bool& extrapolates) {
{% endfilter %}
{% filter wrapped %}
  const double m[detail::N_MARKERS] = { {{- names -}} };
{% endfilter %}
  detail::Kept k;
  detail::freely<detail::SPREAD>(m, &k);
  kept_along = k.along;
  kept_across = k.across;
  share = k.share;
  stderr_ = k.stderr_;
  extrapolates = k.extrapolates;
}

/// kept[0] along gravity, kept[1] across it, kept[2] share of the force of the pressure gradient.
{% filter wrapped %}
GREYBED_DEVICE inline void eval({{ typed }}, double* kept) {
{% endfilter %}
{% filter wrapped %}
  const double m[detail::N_MARKERS] = { {{- names -}} };
{% endfilter %}
  detail::Kept k;
  detail::freely<detail::NOTHING>(m, &k);
  kept[0] = k.along;
  kept[1] = k.across;
  kept[2] = k.share;
}

/// The same, and gradient[{{ markers|length }} k + i] = derivative of kept[k] for marker i{{ ", of all but the forest, which is constant between its cuts" if kind == "forest" }}.
{% filter wrapped %}
GREYBED_DEVICE inline void eval_grad({{ typed }}, double* kept, double* gradient) {
{% endfilter %}
{% filter wrapped %}
  const double m[detail::N_MARKERS] = { {{- names -}} };
{% endfilter %}
  detail::Kept k;
  detail::freely<detail::OF_MARKERS>(m, &k);
  kept[0] = k.along;
  kept[1] = k.across;
  kept[2] = k.share;
  for (int i = 0; i < detail::N_MARKERS; ++i) {
    for (int row = 0; row < 3; ++row) gradient[detail::N_MARKERS * row + i] = k.slope[row][i];
  }
}

/// n rows: kept_along, kept_across and share, an array each.
{% filter wrapped %}
GREYBED_DEVICE inline void eval_batch(std::size_t n, {{ columns_in }}, double* kept_along, double* kept_across, double* share) {
{% endfilter %}
  for (std::size_t k = 0; k < n; ++k) {
    double kept[3];
{% filter wrapped %}
    eval({{ of_row }}, kept);
{% endfilter %}
    kept_along[k] = kept[0];
    kept_across[k] = kept[1];
    share[k] = kept[2];
  }
}

/// Whether all markers are in their ranges, and in the training data where the gate is open.
{% filter wrapped %}
GREYBED_DEVICE inline bool in_domain({{ typed }}) {
{% endfilter %}
{% filter wrapped %}
  const double m[detail::N_MARKERS] = { {{- names -}} };
{% endfilter %}
  if (!detail::in_range(m)) return false;
  detail::Features f;
  detail::features_of(m, std::log(m[2]), &f);
  return !(detail::gate(m[0], m[1], nullptr, nullptr) > 0.0 && detail::outside(f.value));
}

{% include "force.hpp" %}
/// Whether one golden row comes out, from every function that gives it.
inline bool golden_row(const double* m, const double* wanted) {
  detail::Kept k;
  detail::freely<detail::SPREAD>(m, &k);
  detail::Kept graded;
  detail::freely<detail::OF_MARKERS>(m, &graded);
  return detail::close(k.along, wanted[0]) && detail::close(k.across, wanted[1]) &&
         detail::close(k.share, wanted[2]) && detail::close(k.stderr_, wanted[3]) &&
         detail::close(graded.along, wanted[0]) && detail::close(graded.across, wanted[1]) &&
         detail::close(graded.share, wanted[2]);
}

