{# A grey-box term: a factor in one number. #}
{% set z = markers[0].name %}
/// Added share [-] at {{ z }} >= 0 [{{ unit }}]; in the type of the number.
namespace detail {

template <class T>
GREYBED_DEVICE inline T factor_of(const T& z) {
  const T added = {{ amplitude }} * pow_of(z / {{ reference }}, {{ exponent }});
  return {{ "1.0 + added" if side > 0 else "1.0 / (1.0 + added)" }};
}

}  // namespace detail

/// The factor, above 0, and exactly 1 where {{ limit }}. NaN where the number makes no sense.
GREYBED_DEVICE inline double eval(double {{ z }}) {
  return detail::in_range(&{{ z }}) ? detail::factor_of({{ z }}) : detail::not_a_number();
}

/// The same, and its derivative.
GREYBED_DEVICE inline double eval_grad(double {{ z }}, double* gradient) {
  if (!detail::in_range(&{{ z }})) return *gradient = detail::not_a_number();
  const double unit[4] = {1.0, 0.0, 0.0, 0.0};
  detail::Dual<1> of({{ z }});
  of.d.get(unit);
  const detail::Dual<1> factor = detail::factor_of(of);
  double all[4];
  factor.d.put(all);
  *gradient = all[0];
  return factor.v;
}

/// Of n numbers.
GREYBED_DEVICE inline void eval_batch(std::size_t n, const double* {{ z }}, double* factor) {
  for (std::size_t k = 0; k < n; ++k) factor[k] = eval({{ z }}[k]);
}

/// Whether the number lies in the window that the term was fitted to.
GREYBED_DEVICE inline bool in_domain(double {{ z }}) {
  return detail::in_range(&{{ z }}) && {{ z }} >= {{ low }} && {{ z }} <= {{ high }};
}

/// The factor, and whether the number lies outside the window. A term says no error of its own.
GREYBED_DEVICE inline void predict(double {{ z }}, double& factor, bool& extrapolates) {
  factor = eval({{ z }});
  extrapolates = !in_domain({{ z }});
}

/// Physical numbers of one place.
struct GREYBED_TYPE Inputs {
  double {{ inputs[0].name }};  ///< {{ inputs[0].meaning }} [{{ unit }}]
};

/// What a guarded call gives.
struct GREYBED_TYPE Outputs {
  double factor;       ///< [-]
  double gradient[1];  ///< by eval_grad [1 / unit]
};

/// Factor and derivative under a guard; the law without the term is the factor 1.
GREYBED_DEVICE inline Status eval_grad(const Inputs& in, Guard& guard, Outputs& out) {
  ++guard.calls;
  const double z = in.{{ inputs[0].name }};
  const bool sensible = detail::in_range(&z);
  if (sensible && in_domain(z)) {
    out.factor = eval_grad(z, out.gradient);
    return Status::inside;
  }
  ++guard.outside;
  if (!sensible) ++guard.invalid;
  out.gradient[0] = 0.0;
  if (!sensible || guard.policy == Policy::abort) {
    out.factor = out.gradient[0] = detail::not_a_number();
    return Status::refused;
  }
  if (guard.policy == Policy::baseline) {
    out.factor = 1.0;
    return Status::baseline;
  }
  if (guard.policy == Policy::extrapolate) {
    out.factor = eval_grad(z, out.gradient);
    return Status::extrapolated;
  }
  out.factor = eval(z < {{ low }} ? {{ low }} : {{ high }});
  return Status::clamped;
}
GREYBED_DEVICE inline Status eval(const Inputs& in, Guard& guard, Outputs& out) {
  return eval_grad(in, guard, out);
}

/// Whether one golden row comes out, from every function that gives it.
inline bool golden_row(const double* z, const double* wanted) {
  double gradient;
  double batch;
  eval_batch(1, z, &batch);
  return detail::close(eval(*z), wanted[0]) && detail::close(eval_grad(*z, &gradient), wanted[0]) &&
         detail::close(batch, wanted[0]);
}

