{# A network: its layers, one call for all outputs. #}
/// x = tanh(x) to a few 1e-16, in plain arithmetic that becomes vector instructions.
/// No step relies on the order of rounding, so -ffast-math cannot break it.
template <int N>
inline void squash(double* x) {
  double y[N];
  // A loop of its own: a compiler that knows y = -40 in one branch would branch in the next loop.
  for (int j = 0; j < N; ++j) {
    const double wide = -2.0 * std::fabs(x[j]);
    y[j] = wide > -40.0 ? wide : -40.0;  // tanh(20) rounds to 1
  }
  for (int j = 0; j < N; ++j) {
    // e^y = 2^k e^r with |r| <= log(2) / 2; the cast cuts towards zero, which rounds as y <= 0
    const int k = static_cast<int>(y[j] * 1.4426950408889634 - 0.5);
    const double r = (y[j] - k * 0.693147180369123816490) - k * 1.90821492927058770002e-10;
    double e = 1.0 / 6227020800.0;
    e = e * r + 1.0 / 479001600.0;
    e = e * r + 1.0 / 39916800.0;
    e = e * r + 1.0 / 3628800.0;
    e = e * r + 1.0 / 362880.0;
    e = e * r + 1.0 / 40320.0;
    e = e * r + 1.0 / 5040.0;
    e = e * r + 1.0 / 720.0;
    e = e * r + 1.0 / 120.0;
    e = e * r + 1.0 / 24.0;
    e = e * r + 1.0 / 6.0;
    e = e * r + 0.5;
    e = e * r + 1.0;
    e = e * r + 1.0;
    const std::uint64_t bits = static_cast<std::uint64_t>(k + 1023) << 52;
    double power;
    std::memcpy(&power, &bits, sizeof power);
    e *= power;
    x[j] = std::copysign((1.0 - e) / (1.0 + e), x[j]);
  }
}

/// y = x W + b; the neurons run innermost so that they share vector instructions.
template <int N_IN, int N_OUT>
inline void dense(const double* x, const double* weight, const double* bias, double* y) {
  double sum[N_OUT];
  for (int j = 0; j < N_OUT; ++j) sum[j] = bias[j];
  for (int i = 0; i < N_IN; ++i) {
    for (int j = 0; j < N_OUT; ++j) sum[j] += x[i] * weight[i * N_OUT + j];
  }
  for (int j = 0; j < N_OUT; ++j) y[j] = sum[j];
}

/// Network: value and spread before their bounds.
inline void predictor(const double* features, double* raw) {
  double x_0[{{ layers[0][0] }}];
  for (int i = 0; i < {{ layers[0][0] }}; ++i) x_0[i] = (features[i] - mean()[i]) / scale()[i];
{% for n_in, n_out in layers %}
{% if loop.last %}
  dense<{{ n_in }}, {{ n_out }}>(x_{{ loop.index0 }}, weight_{{ loop.index0 }}(), bias_{{ loop.index0 }}(), raw);
{% else %}
  double x_{{ loop.index }}[{{ n_out }}];
  dense<{{ n_in }}, {{ n_out }}>(x_{{ loop.index0 }}, weight_{{ loop.index0 }}(), bias_{{ loop.index0 }}(), x_{{ loop.index }});
  squash<{{ n_out }}>(x_{{ loop.index }});
{% endif %}
{% endfor %}
}

