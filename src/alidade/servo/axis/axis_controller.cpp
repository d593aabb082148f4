#include "alidade/servo/axis/axis_controller.h"

#include <cmath>

namespace alidade {

std::string_view controller_name(ControllerKind kind) {
  constexpr std::array<std::string_view, 4> names{"pi", "feedforward", "lqr", "mpc"};
  return names[static_cast<std::size_t>(kind)];
}

std::optional<ControllerKind> controller_named(std::string_view name) {
  for (const ControllerKind kind : controller_kinds)
    if (controller_name(kind) == name) return kind;
  return std::nullopt;
}

AxisController::AxisController(const ServoConfig& config, const ServoAxis& axis, double focal_px)
    : kind_(config.controller),
      gains_(config.pi.per_rad(focal_px)),
      rate_gain_per_s_(config.rate_gain_per_s),
      model_(sampled(axis.plant, config.period_s)),
      lqr_gain_(lqr_gain(model_, config.command_weight)),
      mpc_(axis, model_, config.command_weight),
      observer_(linear_part(axis), model_, config.sigma_encoder_rad),
      expected_(linear_part(axis), {}),
      dead_band_(axis.dead_band) {}

/// u_k = kp e_k + ki Σ_{i<k} e_i T.
double AxisController::pi_command(double error_rad) {
  const double command = gains_.kp * error_rad + gains_.ki * integral_;
  integral_ += model_.period_s * error_rad;
  return command;
}

/// Command that moves the axis, according to its model, along the target; kp and ki act on the difference between the
/// model's angle and the measured one. (On the difference from the target itself they would act twice, and
/// overshoot after a jump.)
double AxisController::feedforward_on_angle(const AxisInput& input) {
  const auto& wanted = *input.wanted_rad;
  const double ahead = command_between(model_, {wanted[0], 0.0}, {wanted[1], 0.0});
  const double correction = pi_command(expected_.motion().angle_rad - input.encoder_rad);
  expected_.send(ahead);
  expected_.advance(model_.period_s);
  return ahead + correction;
}

/// u = k (θ − θ_encoder) + dθ, as rates; dθ is taken after the lag: at half a period plus τ.
double AxisController::feedforward_on_rate(const AxisInput& input) const {
  const auto& wanted = *input.wanted_rad;
  const ServoPlant& plant = expected_.axis().plant;
  const double ahead_s = 0.5 * model_.period_s + tau_of(plant);
  const double acceleration = (input.wanted_rate_rad_s[1] - input.wanted_rate_rad_s[0]) / model_.period_s;
  const double error = wanted[0] - observer_.state_at_effect()[0];
  return (rate_gain_per_s_ * error + input.wanted_rate_rad_s[0] + acceleration * ahead_s) / gain_of(plant);
}

double AxisController::lqr_command(const AxisInput& input) const {
  const auto& wanted = *input.wanted_rad;
  const Eigen::Vector2d now(wanted[0], model_.is_rate_plant ? input.wanted_rate_rad_s[0] : 0.0);
  return command_between(model_, now, {wanted[1], input.wanted_rate_rad_s[1]}) +
         lqr_gain_.dot(now - observer_.state_at_effect()) - observer_.disturbance();
}

double AxisController::command(const AxisInput& input) {
  if (!has_started_) {
    observer_.start(input.encoder_rad);
    expected_.set_motion({input.encoder_rad, 0.0});
    has_started_ = true;
  } else {
    observer_.update(input.encoder_rad);
  }
  double command = 0.0;
  if (kind_ == ControllerKind::pi) {
    command = pi_command(input.error_rad);
  } else if (!input.wanted_rad) {
    const double stay = model_.is_rate_plant ? 0.0 : input.encoder_rad / gain_of(expected_.axis().plant);
    command = stay;
    expected_.set_motion({input.encoder_rad, 0.0});
  } else if (kind_ == ControllerKind::lqr) {
    command = lqr_command(input);
  } else if (kind_ == ControllerKind::mpc) {
    command =
        mpc_.command(observer_.state_at_effect(), observer_.disturbance(), *input.wanted_rad, input.wanted_rate_rad_s);
  } else {
    command = model_.is_rate_plant ? feedforward_on_rate(input) : feedforward_on_angle(input);
  }
  observer_.send(command);
  return command == 0.0 ? 0.0 : command + std::copysign(dead_band_, command);  // compensates the dead band
}

}  // namespace alidade
