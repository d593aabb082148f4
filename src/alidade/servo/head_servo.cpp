#include "alidade/servo/head_servo.h"

#include <cmath>
#include <numbers>

namespace alidade {

std::string_view servo_event_name(ServoEvent event) {
  constexpr std::array<std::string_view, 8> names{"none",   "waiting", "started",   "gated",
                                                  "jumped", "lost",    "searching", "found"};
  return names[static_cast<std::size_t>(event)];
}

// fx, fy, cx, cy come first in every model.
Eigen::Vector2d centre_of(const Camera& camera) { return params(camera.lens).segment<2>(2); }
double focal_of(const Camera& camera) { return params(camera.lens).head<2>().mean(); }

HeadServo::HeadServo(const RigHead& head, const ServoConfig& config)
    : head_(head),
      config_(config),
      centre_px_(centre_of(head.camera)),
      focal_px_(focal_of(head.camera)),
      sigma_bearing_rad_(std::hypot(config.sigma_px / focal_px_, config.sigma_encoder_rad)),
      filter_(config.filter),
      search_(config.search, head.camera.height_px / focal_px_),
      axes_{AxisController(config, config.axes[0], focal_px_), AxisController(config, config.axes[1], focal_px_)} {}

std::optional<Eigen::Vector2d> HeadServo::bearing_of(const HeadSight& sight) const {
  const Eigen::Vector2d own_px = sight.lens ? Zoomed(head_.camera, sight.lens->k).own_px(sight.px) : sight.px;
  const auto ray = ray_in_world(head_, sight.pan_tilt_rad, own_px);
  if (!ray) return std::nullopt;
  auto bearing = aim(head_.head, ray->origin_in_world + config_.range_m * ray->direction_in_world);
  if (!bearing) return std::nullopt;
  for (int axis = 0; axis < 2; ++axis) {  // on the turn that the head is on
    double& angle = (*bearing)[axis];
    angle = sight.pan_tilt_rad[axis] + std::remainder(angle - sight.pan_tilt_rad[axis], 2.0 * std::numbers::pi);
  }
  return bearing;
}

/// bearing = reading − (px − c) / f: by a σ of f, and by one of c.
std::array<LensEffect, 2> HeadServo::lens_effects(const HeadSight& sight) const {
  std::array<LensEffect, 2> effects{LensEffect::Zero(), LensEffect::Zero()};
  if (!sight.lens) return effects;
  const LensNow& lens = *sight.lens;
  for (Eigen::Index axis = 0; axis < 2; ++axis) {
    const double f = lens.k[axis], offset = (sight.px[axis] - lens.k[2 + axis]) / f;
    effects[static_cast<std::size_t>(axis)] = {offset * lens.sigma[axis] / f, lens.sigma[2 + axis] / f};
  }
  return effects;
}

SightUse HeadServo::take(const HeadSight& sight) {
  const auto bearing = bearing_of(sight);
  if (!bearing || !bearing->allFinite()) return SightUse::late;
  const Eigen::Vector2d centre_px = sight.lens ? Eigen::Vector2d(sight.lens->k.tail<2>()) : centre_px_;
  const double focal_px = sight.lens ? sight.lens->k.head<2>().mean() : focal_px_;
  const double sigma_rad =
      sight.lens ? std::hypot(config_.sigma_px / focal_px, config_.sigma_encoder_rad) : sigma_bearing_rad_;
  const SightUse use = filter_.take(sight.t_capture_s, *bearing, sigma_rad, lens_effects(sight));
  if (use != SightUse::late) error_rad_ = -(sight.px - centre_px) / focal_px;  // pan > 0 left, tilt > 0 up
  return use;
}

/// Uses the picture and says what became of the target.
ServoEvent HeadServo::follow(const HeadServoInput& input) {
  if (input.sight) {
    if (is_lost_) filter_.forget();
    const SightUse use = take(*input.sight);
    if (use != SightUse::late) {
      last_seen_s_ = input.t_s;
      const bool was_lost = is_lost_;
      is_lost_ = false;
      if (was_lost) return ServoEvent::found;
      if (use == SightUse::gated) return ServoEvent::gated;
      if (use == SightUse::restarted) return ServoEvent::jumped;
      return use == SightUse::started ? ServoEvent::started : ServoEvent::none;
    }
  }
  if (!filter_.has_started()) return ServoEvent::waiting;
  if (is_lost_) return ServoEvent::searching;
  if (input.t_s - last_seen_s_ <= config_.search.coast_s) return ServoEvent::none;
  is_lost_ = true;
  error_rad_.setZero();
  search_.begin(input.t_s, filter_.at(last_seen_s_));
  return ServoEvent::lost;
}

void HeadServo::ask_for_target(double t_effect_s, std::array<AxisInput, 2>& inputs) const {
  const std::array<Bearing, 2> bearings = filter_.at(t_effect_s);
  for (std::size_t axis = 0; axis < 2; ++axis) {
    auto& wanted = inputs[axis].wanted_rad.emplace();
    for (int i = 0; i <= mpc_horizon; ++i) {
      const Bearing there = ahead(bearings[axis], config_.filter.singer_tau_s, i * config_.period_s);
      wanted[i] = there.angle_rad;
      inputs[axis].wanted_rate_rad_s[i] = there.rate_rad_s;
    }
  }
}

void HeadServo::ask_for_search(double t_effect_s, std::array<AxisInput, 2>& inputs) const {
  for (AxisInput& input : inputs) input.wanted_rad.emplace();
  for (int i = 0; i <= mpc_horizon; ++i) {
    const Eigen::Vector2d there = search_.at(t_effect_s + i * config_.period_s);
    const Eigen::Vector2d next = search_.at(t_effect_s + (i + 1) * config_.period_s);
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const auto k = static_cast<Eigen::Index>(axis);
      (*inputs[axis].wanted_rad)[i] = there[k];
      inputs[axis].wanted_rate_rad_s[i] = (next[k] - there[k]) / config_.period_s;
    }
  }
}

HeadServoOutput HeadServo::step(const HeadServoInput& input) {
  HeadServoOutput output;
  output.event = follow(input);
  const bool has_target = filter_.has_started();
  std::array<AxisInput, 2> inputs;
  const double t_effect_s = input.t_s + config_.axes[0].command_delay_s;
  if (has_target && !is_lost_)
    ask_for_target(t_effect_s, inputs);
  else if (has_target && config_.search.enabled)
    ask_for_search(t_effect_s, inputs);
  output.asked_rad = input.encoder_rad;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const auto k = static_cast<Eigen::Index>(axis);
    AxisInput& own = inputs[axis];
    own.encoder_rad = input.encoder_rad[k];
    own.error_rad = error_rad_[k];
    if (own.wanted_rad) {
      *own.wanted_rad = own.wanted_rad->cwiseMax(config_.axes[axis].min_rad).cwiseMin(config_.axes[axis].max_rad);
      output.asked_rad[k] = (*own.wanted_rad)[0];
    }
    output.command[k] = axes_[axis].command(own);
  }
  if (has_target && !is_lost_) {
    const std::array<Bearing, 2> now = filter_.at(input.t_s);
    output.predicted_rad = {now[0].angle_rad, now[1].angle_rad};
    output.sigma_rad = {now[0].sigma_rad, now[1].sigma_rad};
    output.has_prediction = true;
  }
  return output;
}

}  // namespace alidade
