#include "alidade/servo/head_servo.h"

#include <cmath>
#include <numbers>

namespace alidade {

std::string_view servo_event_name(ServoEvent event) {
  constexpr std::array<std::string_view, 8> names{"none",   "waiting", "started",   "gated",
                                                  "jumped", "lost",    "searching", "found"};
  return names[static_cast<std::size_t>(event)];
}

// In every lens model fx, fy, cx, cy come first.
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

std::optional<Eigen::Vector2d> HeadServo::bearing_of(const HeadObservation& observation) const {
  const Eigen::Vector2d own_px =
      observation.lens ? Zoomed(head_.camera, observation.lens->k).own_px(observation.px) : observation.px;
  const auto ray = ray_in_world(head_, observation.pan_tilt_rad, own_px);
  if (!ray) return std::nullopt;
  auto bearing = aim(head_.head, ray->origin_in_world + config_.range_m * ray->direction_in_world);
  if (!bearing) return std::nullopt;
  for (int axis = 0; axis < 2; ++axis) {  // on the same revolution as the head
    double& angle = (*bearing)[axis];
    angle =
        observation.pan_tilt_rad[axis] + std::remainder(angle - observation.pan_tilt_rad[axis], 2.0 * std::numbers::pi);
  }
  return bearing;
}

/// bearing = reading − (px − c) / f: effects of one σ of f and of one σ of c.
std::array<LensEffect, 2> HeadServo::lens_effects(const HeadObservation& observation) const {
  std::array<LensEffect, 2> effects{LensEffect::Zero(), LensEffect::Zero()};
  if (!observation.lens) return effects;
  const IntrinsicsSample& lens = *observation.lens;
  for (Eigen::Index axis = 0; axis < 2; ++axis) {
    const double f = lens.k[axis], offset = (observation.px[axis] - lens.k[2 + axis]) / f;
    effects[static_cast<std::size_t>(axis)] = {offset * lens.sigma[axis] / f, lens.sigma[2 + axis] / f};
  }
  return effects;
}

ObservationUse HeadServo::take(const HeadObservation& observation) {
  const auto bearing = bearing_of(observation);
  if (!bearing || !bearing->allFinite()) return ObservationUse::late;
  const Eigen::Vector2d centre_px = observation.lens ? Eigen::Vector2d(observation.lens->k.tail<2>()) : centre_px_;
  const double focal_px = observation.lens ? observation.lens->k.head<2>().mean() : focal_px_;
  const double sigma_rad =
      observation.lens ? std::hypot(config_.sigma_px / focal_px, config_.sigma_encoder_rad) : sigma_bearing_rad_;
  const ObservationUse use = filter_.take(observation.t_capture_s, *bearing, sigma_rad, lens_effects(observation));
  if (use != ObservationUse::late) error_rad_ = -(observation.px - centre_px) / focal_px;  // pan > 0 left, tilt > 0 up
  return use;
}

/// Processes the image, and returns the event of the target.
ServoEvent HeadServo::follow(const HeadServoInput& input) {
  if (input.observation) {
    if (is_lost_) filter_.forget();
    const ObservationUse use = take(*input.observation);
    if (use != ObservationUse::late) {
      last_seen_s_ = input.t_s;
      const bool was_lost = is_lost_;
      is_lost_ = false;
      if (was_lost) return ServoEvent::found;
      if (use == ObservationUse::gated) return ServoEvent::gated;
      if (use == ObservationUse::restarted) return ServoEvent::jumped;
      return use == ObservationUse::started ? ServoEvent::started : ServoEvent::none;
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

void HeadServo::ask_for_target(double now_s, std::array<AxisInput, 2>& inputs) const {
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const Bearing bearing = filter_.at(now_s + config_.axes[axis].command_delay_s)[axis];
    auto& wanted = inputs[axis].wanted_rad.emplace();
    for (int i = 0; i <= mpc_horizon; ++i) {
      const Bearing there = ahead(bearing, config_.filter.singer_tau_s, i * config_.period_s);
      wanted[i] = there.angle_rad;
      inputs[axis].wanted_rate_rad_s[i] = there.rate_rad_s;
    }
  }
}

void HeadServo::ask_for_search(double now_s, std::array<AxisInput, 2>& inputs) const {
  for (AxisInput& input : inputs) input.wanted_rad.emplace();
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const auto k = static_cast<Eigen::Index>(axis);
    const double t_effect_s = now_s + config_.axes[axis].command_delay_s;
    for (int i = 0; i <= mpc_horizon; ++i) {
      const Eigen::Vector2d there = search_.at(t_effect_s + i * config_.period_s);
      const Eigen::Vector2d next = search_.at(t_effect_s + (i + 1) * config_.period_s);
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
  if (has_target && !is_lost_)
    ask_for_target(input.t_s, inputs);
  else if (has_target && config_.search.enabled)
    ask_for_search(input.t_s, inputs);
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
