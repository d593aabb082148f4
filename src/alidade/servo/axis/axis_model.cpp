#include "alidade/servo/axis/axis_model.h"

#include <cmath>

namespace alidade {

AxisModel sampled(const ServoPlant& plant, double period_s) {
  AxisModel model;
  model.period_s = period_s;
  model.is_rate_plant = std::holds_alternative<RatePlant>(plant);
  const double tau_s = tau_of(plant), gain = gain_of(plant), decay = std::exp(-period_s / tau_s);
  if (model.is_rate_plant) {
    const double reach_s = tau_s * -std::expm1(-period_s / tau_s);
    model.A << 1.0, reach_s, 0.0, decay;
    model.B << gain * (period_s - reach_s), gain * (1.0 - decay);
  } else {
    model.A(0, 0) = decay;
    model.B[0] = gain * (1.0 - decay);
  }
  return model;
}

double effect_of_command(const AxisModel& model) {
  return model.is_rate_plant ? model.period_s * model.B[1] : model.B[0];
}

Eigen::RowVector2d lqr_gain(const AxisModel& model, double command_weight) {
  const Eigen::Matrix2d Q = Eigen::Vector2d(1.0, 0.0).asDiagonal();
  const double effect = effect_of_command(model), R = command_weight * effect * effect;
  Eigen::Matrix2d P = Q;
  Eigen::RowVector2d K = Eigen::RowVector2d::Zero();
  for (int i = 0; i < 2000; ++i) {  // converges with the square of the slowest closed-loop pole: tens of steps
    const double S = R + model.B.dot(P * model.B);
    const Eigen::RowVector2d next = (model.B.transpose() * P * model.A) / S;
    P = Q + model.A.transpose() * P * (model.A - model.B * next);
    const bool is_settled = (next - K).norm() <= 1e-12 * next.norm();
    K = next;
    if (is_settled) break;
  }
  return K;
}

double command_between(const AxisModel& model, const Eigen::Vector2d& wanted, const Eigen::Vector2d& next) {
  const int row = model.is_rate_plant ? 1 : 0;
  return (next[row] - model.A.row(row).dot(wanted)) / model.B[row];
}

}  // namespace alidade
