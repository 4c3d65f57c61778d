{# Filtered drag: from physical numbers to a force and its derivative. #}
/// Particles of one size in a gas under gravity, and what filtered drag is scaled with; SI.
struct GREYBED_TYPE Material {
  double diameter_m;
  double gas_viscosity_pa_s;
  double gas_weight_n_m3;       ///< rho_g g
  double up[3];                 ///< against gravity [-]
  double weight_n_m3;           ///< (rho_p - rho_g) g
  double terminal_velocity_m_s;
  double terminal_reynolds;     ///< [-]
  double log_reynolds;          ///< its logarithm
  double terminal_drag;         ///< F of one settling particle [-]
  double length_m;              ///< L_c
  double reynolds_s_m;          ///< rho_g d / mu
  double stokes_kg_m3_s;        ///< 18 mu / d^2
  double inverse_velocity_s_m;  ///< 1 / u_t
  double inverse_weight_m3_n;   ///< 1 / weight
  double inverse_length_1_m;    ///< 1 / L_c
  double inverse_drag;          ///< 1 / terminal_drag [-]
};

/// F of Schiller & Naumann times (1 - phi)^-3.65 (Wen & Yu), and Re dF/dRe in slope.
GREYBED_DEVICE inline double wen_yu(double solid_fraction, double reynolds, double* slope) {
  const double swarm = std::pow(1.0 - solid_fraction, -3.65);
  const bool slow = reynolds < 1000.0;
  const double part = slow ? 0.15 * std::pow(reynolds, 0.687) : 0.44 * reynolds / 24.0;
  *slope = swarm * (slow ? 0.687 * part : part);
  return swarm * (slow ? 1.0 + part : part);
}

/// Make a material, once. Particles must be heavier than the gas; gravity must not be 0.
GREYBED_DEVICE inline Material material(double diameter_m, double particle_density_kg_m3,
                                        double gas_density_kg_m3, double gas_viscosity_pa_s,
                                        const double* gravity_m_s2) {
  Material m;
  const double g = std::sqrt(gravity_m_s2[0] * gravity_m_s2[0] + gravity_m_s2[1] * gravity_m_s2[1] +
                             gravity_m_s2[2] * gravity_m_s2[2]);
  for (int i = 0; i < 3; ++i) m.up[i] = -gravity_m_s2[i] / g;
  m.diameter_m = diameter_m;
  m.gas_viscosity_pa_s = gas_viscosity_pa_s;
  m.gas_weight_n_m3 = gas_density_kg_m3 * g;
  m.weight_n_m3 = (particle_density_kg_m3 - gas_density_kg_m3) * g;
  m.reynolds_s_m = gas_density_kg_m3 * diameter_m / gas_viscosity_pa_s;
  m.stokes_kg_m3_s = 18.0 * gas_viscosity_pa_s / (diameter_m * diameter_m);
  const double stokes = m.weight_n_m3 / m.stokes_kg_m3_s;
  double low = 0.0;
  double high = stokes;
  double slope;
  // Drag grows with velocity, so halving finds the one root whatever the jump at Re = 1000.
  for (int k = 0; k < 100; ++k) {
    const double middle = 0.5 * (low + high);
    if (middle * wen_yu(0.0, m.reynolds_s_m * middle, &slope) < stokes) {
      low = middle;
    } else {
      high = middle;
    }
  }
  m.terminal_velocity_m_s = 0.5 * (low + high);
  m.terminal_reynolds = m.reynolds_s_m * m.terminal_velocity_m_s;
  m.log_reynolds = std::log(m.terminal_reynolds);
  m.terminal_drag = stokes / m.terminal_velocity_m_s;
  m.length_m = diameter_m * std::cbrt(m.terminal_velocity_m_s * m.terminal_velocity_m_s /
                                      (g * diameter_m));
  m.inverse_velocity_s_m = 1.0 / m.terminal_velocity_m_s;
  m.inverse_weight_m3_n = 1.0 / m.weight_n_m3;
  m.inverse_length_1_m = 1.0 / m.length_m;
  m.inverse_drag = 1.0 / m.terminal_drag;
  return m;
}

/// Physical numbers of one place: the fields of the coarse grid, SI.
struct GREYBED_TYPE Inputs {
  double solid_fraction;                ///< [-]
  double gas_velocity_m_s[3];
  double particle_velocity_m_s[3];
  double pressure_gradient_pa_m[3];     ///< {{ "with its mean in a periodic box" if pressure else "not used by this closure" }}
  double filter_size_m;                 ///< edge of the filter, at least that of the cell
  double parcels;                       ///< diameter of a parcel over that of its particles, 1 if none [-]
};

/// A drag law at these fields: beta = 18 mu eps phi F / d^2, Re = eps rho_g d |slip| / mu.
struct GREYBED_TYPE Law {
  double factor;  ///< F [-]
  double steep;   ///< Re dF/dRe [-]
};

/// What a guarded call gives: the drag on the particles in a unit volume of gas and particles.
struct GREYBED_TYPE Outputs {
  double force_n_m3[3];
  double derivative_n_s_m4[9];  ///< by eval_grad: [3 i + j] = dF_i / dslip_j
  double exchange_kg_m3_s;      ///< F.slip / slip^2, the coefficient for a host that takes one
  double unfiltered_kg_m3_s;    ///< beta of the drag law alone
  double kept_along;            ///< [-]
  double kept_across;           ///< [-]
  double share;                 ///< of the pressure gradient's force that is in it [-]
};

namespace detail {

template <bool SLOPES>
GREYBED_DEVICE inline Status force_of(const Material& m, const Inputs& in, const Law& law,
                                      Guard& guard, Outputs& out) {
  const double phi = in.solid_fraction;
  double slip[3];
  for (int i = 0; i < 3; ++i) slip[i] = in.gas_velocity_m_s[i] - in.particle_velocity_m_s[i];
  const double s_up = slip[0] * m.up[0] + slip[1] * m.up[1] + slip[2] * m.up[2];
  double lateral[3];
  double across2 = 0.0;
  double speed2 = 0.0;
  for (int i = 0; i < 3; ++i) {
    lateral[i] = slip[i] - s_up * m.up[i];
    across2 += lateral[i] * lateral[i];
    speed2 += slip[i] * slip[i];
  }
{% if pressure %}
  double fall[3];
  for (int i = 0; i < 3; ++i) fall[i] = -in.pressure_gradient_pa_m[i] - m.gas_weight_n_m3 * m.up[i];
{% endif %}
{% if gradient %}
  const double fall_up = fall[0] * m.up[0] + fall[1] * m.up[1] + fall[2] * m.up[2];
  const double of_fall = m.inverse_velocity_s_m * m.inverse_weight_m3_n;
  double fall_across[3];
  double work = 0.0;
  for (int i = 0; i < 3; ++i) {
    fall_across[i] = fall[i] - fall_up * m.up[i];
    work += fall[i] * lateral[i];
  }
{% endif %}
  const double ratio = law.factor * m.inverse_drag;
  const double marker[N_MARKERS] = {
      phi, in.filter_size_m * m.inverse_length_1_m, m.terminal_reynolds, s_up * m.inverse_velocity_s_m,
      std::sqrt(across2) * m.inverse_velocity_s_m,
{% if gradient %}
      fall_up * m.inverse_weight_m3_n, work * of_fall, ratio,
{% endif %}
      in.parcels};
  const double beta = m.stokes_kg_m3_s * (1.0 - phi) * phi * law.factor;
  // Relative slope of beta over the slip, which is 0 without slip.
  const double relative = law.steep / (law.factor * (speed2 > 1e-300 ? speed2 : 1e-300));
  double* const force = out.force_n_m3;
  double* const derivative = out.derivative_n_s_m4;
  Kept kept;
  const Status status = guarded<(SLOPES ? OF_SLIP : NOTHING)>(marker, m.log_reynolds, guard, &kept);
  out.unfiltered_kg_m3_s = beta;
  out.kept_along = kept.along;
  out.kept_across = kept.across;
  out.share = 0.0;
  if (status == Status::baseline) {  // not by way of two directions: exactly the drag law
    for (int i = 0; i < 3; ++i) {
      force[i] = beta * slip[i];
      if (SLOPES) {
        for (int j = 0; j < 3; ++j) {
          derivative[3 * i + j] = beta * ((i == j ? 1.0 : 0.0) + slip[i] * relative * slip[j]);
        }
      }
    }
    out.exchange_kg_m3_s = beta;
    return status;
  }
  const double up_part = beta * kept.along;
  const double across_part = beta * kept.across;
  for (int i = 0; i < 3; ++i) force[i] = up_part * s_up * m.up[i] + across_part * lateral[i];
{% if linear %}
  double change[3][3];  // of ln H along and across, and of the share
{% else %}
  double change[2][3];  // of ln H along and across
{% endif %}
  if (SLOPES) {
    const double of_up = m.inverse_velocity_s_m;
    const double of_lateral = 2.0 * of_up * of_up;
    const double of_ratio = ratio * relative;
    for (int k = 0; k < {{ 3 if linear else 2 }}; ++k) {
      const double* const s = kept.slope[k];
      const double a = s[0] * of_up;
      const double b = s[1] * of_lateral;
{% if gradient %}
      const double c = s[2] * of_fall;
{% endif %}
      const double d = s[3] * of_ratio + {{ "(k < 2 ? relative : 0.0)" if linear else "relative" }};
      for (int j = 0; j < 3; ++j) {
        change[k][j] = a * m.up[j] + b * lateral[j]{{ " + c * fall_across[j]" if gradient }} + d * slip[j];
      }
    }
    for (int i = 0; i < 3; ++i) {
      const double along = up_part * s_up * m.up[i];
      const double across = across_part * lateral[i];
      const double outer = (up_part - across_part) * m.up[i];
      for (int j = 0; j < 3; ++j) {
        derivative[3 * i + j] = outer * m.up[j] + along * change[0][j] + across * change[1][j];
      }
      derivative[4 * i] += across_part;
    }
  }
{% if linear %}
  // The share of the gradient's force fades before it could drive the gas: see force.py.
  double pull[3];
  double done = 0.0;
  double against = 0.0;
  double pull2 = 0.0;
  for (int i = 0; i < 3; ++i) {
    pull[i] = (1.0 - phi) * fall[i];
    done += force[i] * slip[i];
    against += pull[i] * slip[i];
    pull2 += pull[i] * pull[i];
  }
  const double small = {{ fade }} * m.terminal_velocity_m_s;
  const double small2 = small * small * pull2;
  const double root = std::sqrt(against * against + small2);
  const double sum = root > 0.0 ? root + (against < 0.0 ? -against : against) : 1.0;
  const double n = against < 0.0 ? 0.5 * sum : 0.5 * small2 / sum;
  const double below = done + kept.share * n;
  const double part = 1.0 / (below > 0.0 ? below : 1.0);
  const double whole = kept.share * part;
  const double share = whole * done;
  if (SLOPES) {
    const double of_whole = done * part * (done * part);
    const double both = whole * whole;
    const double of_work = both * n;
    const double of_n = -both * done * 0.5 * (against / (root > 0.0 ? root : 1.0) - 1.0);
    double of_share[3];
    for (int j = 0; j < 3; ++j) {
      double work_slope = force[j];
      for (int i = 0; i < 3; ++i) work_slope += derivative[3 * i + j] * slip[i];
      of_share[j] = of_whole * change[2][j] + of_work * work_slope + of_n * pull[j];
    }
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        derivative[3 * i + j] =
            (1.0 - share) * derivative[3 * i + j] + (pull[i] - force[i]) * of_share[j];
      }
    }
  }
  for (int i = 0; i < 3; ++i) force[i] = (1.0 - share) * force[i] + share * pull[i];
  out.share = share;
{% endif %}
  const double power = force[0] * slip[0] + force[1] * slip[1] + force[2] * slip[2];
  // Without slip there is no direction: the mean of the three.
  out.exchange_kg_m3_s = speed2 > 1e-300 ? power / speed2 : (up_part + 2.0 * across_part) / 3.0;
  return status;
}

/// Wen & Yu at these fields.
GREYBED_DEVICE inline Law wen_yu_at(const Material& m, const Inputs& in) {
  double speed2 = 0.0;
  for (int i = 0; i < 3; ++i) {
    const double s = in.gas_velocity_m_s[i] - in.particle_velocity_m_s[i];
    speed2 += s * s;
  }
  Law law;
  const double reynolds = (1.0 - in.solid_fraction) * m.reynolds_s_m * std::sqrt(speed2);
  law.factor = wen_yu(in.solid_fraction, reynolds, &law.steep);
  return law;
}

}  // namespace detail

/// Filtered drag under a guard, of your own drag law or of Wen & Yu. The training data had the drag
/// law {{ law }}.
GREYBED_DEVICE inline Status eval(const Material& m, const Inputs& in, const Law& law, Guard& guard,
                                  Outputs& out) {
  return detail::force_of<false>(m, in, law, guard, out);
}
GREYBED_DEVICE inline Status eval(const Material& m, const Inputs& in, Guard& guard, Outputs& out) {
  return eval(m, in, detail::wen_yu_at(m, in), guard, out);
}

/// The same with the derivative for the slip.
GREYBED_DEVICE inline Status eval_grad(const Material& m, const Inputs& in, const Law& law,
                                       Guard& guard, Outputs& out) {
  return detail::force_of<true>(m, in, law, guard, out);
}
GREYBED_DEVICE inline Status eval_grad(const Material& m, const Inputs& in, Guard& guard,
                                       Outputs& out) {
  return eval_grad(m, in, detail::wen_yu_at(m, in), guard, out);
}

/// Force on one particle, as the one of a unit volume shares out over its particles [N].
GREYBED_DEVICE inline void on_particle(const Material& m, const Inputs& in, const Outputs& out,
                                       double* force_n) {
  const double volume = 0.52359877559829882 * m.diameter_m * m.diameter_m * m.diameter_m;
  const double each = volume / (in.solid_fraction > 1e-12 ? in.solid_fraction : 1e-12);
  for (int i = 0; i < 3; ++i) force_n[i] = each * out.force_n_m3[i];
}

