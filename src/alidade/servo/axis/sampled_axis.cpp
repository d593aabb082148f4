#include "alidade/servo/axis/sampled_axis.h"

#include <Eigen/LU>
#include <cmath>

#include "alidade/servo/axis/axis_model.h"

namespace alidade {
namespace {

struct LinearStep {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d B = Eigen::Vector3d::Zero();
};

/// Computed column by column, as the response of the axis to a unit of each state.
LinearStep lagged_step(const ServoAxis& axis, double dt_s) {
  const bool is_rate_plant = std::holds_alternative<RatePlant>(axis.plant);
  const auto after = [&](const Eigen::Vector3d& state, double command) -> Eigen::Vector3d {
    const LaggedMotion next =
        advanced_behind_lag(axis.plant, axis.second_tau_s, {{state[0], state[1]}, state[2]}, command, dt_s);
    return {next.motion.angle_rad, is_rate_plant ? next.motion.rate_rad_s : 0.0, next.lagged};
  };
  LinearStep step;
  for (Eigen::Index i = 0; i < 3; ++i) step.A.col(i) = after(Eigen::Vector3d::Unit(i), 0.0);
  step.B = after(Eigen::Vector3d::Zero(), 1.0);
  return step;
}

LinearStep linear_step(const ServoAxis& axis, double dt_s) {
  if (axis.second_tau_s > 0.0) return lagged_step(axis, dt_s);
  const AxisModel model = sampled(axis.plant, dt_s);
  LinearStep step;
  step.A.topLeftCorner<2, 2>() = model.A;
  step.B.head<2>() = model.B;
  return step;
}

}  // namespace

SampledAxis sampled_with_delay(const ServoAxis& axis, double period_s) {
  SampledAxis result;
  const double periods = axis.command_delay_s / period_s, whole = std::floor(periods + 1e-9);
  const double rest_s = std::max(0.0, periods - whole) * period_s;
  result.delay_samples = static_cast<int>(whole);
  if (rest_s < 1e-9 * period_s) {
    const LinearStep step = linear_step(axis, period_s);
    result.A = step.A;
    result.now = step.B;
    return result;
  }
  const LinearStep first = linear_step(axis, rest_s), second = linear_step(axis, period_s - rest_s);
  result.A = second.A * first.A;
  result.before = second.A * first.B;
  result.now = second.B;
  return result;
}

std::complex<double> SampledAxis::response(std::complex<double> z) const {
  const Eigen::Matrix3cd left = z * Eigen::Matrix3cd::Identity() - A.cast<std::complex<double>>();
  const Eigen::Vector3cd right = now.cast<std::complex<double>>() + before.cast<std::complex<double>>() / z;
  return left.partialPivLu().solve(right)[0];
}

}  // namespace alidade
