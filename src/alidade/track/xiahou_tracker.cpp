#include "alidade/track/xiahou_tracker.h"

#include <algorithm>
#include <cmath>

namespace alidade {
namespace {

/// The angles (pan, tilt) at which a head without rotation and offsets would look along the ray of an observation.
std::optional<Eigen::Vector2d> angles_of_ray(const RigHead& head, const TargetObservation& observation) {
  const auto ray = ray_in_world(head, observation);
  if (!ray) return std::nullopt;
  const Eigen::Vector3d& d = ray->direction_in_world;
  return Eigen::Vector2d(-std::atan2(d.x(), d.z()), -std::atan2(d.y(), std::hypot(d.x(), d.z())));
}

}  // namespace

XiahouTracker::XiahouTracker(std::span<const RigHead> heads, const XiahouConfig& config)
    : heads_(heads.begin(), heads.end()),
      config_(config),
      origin_in_world_(heads.empty() ? Eigen::Vector3d(Eigen::Vector3d::Zero())
                                     : heads[0].head.world_from_base.translation) {}

TrackStep XiahouTracker::step_now() const {
  constexpr double m_per_cm = 0.01;
  constexpr std::array<int, 6> place{0, 2, 4, 1, 3, 5};  // indices of x, y, z, vx, vy, vz in the paper's state
  TrackStep step;
  step.t_s = filter_time_s_;
  step.has_belief = step.accepted = true;
  step.event = TrackEvent::none;
  for (int i = 0; i < 6; ++i) {
    const int from = place[static_cast<std::size_t>(i)];
    step.belief.x[i] = m_per_cm * filter_->state().x[from];
    for (int j = 0; j < 6; ++j)
      step.belief.P(i, j) = m_per_cm * m_per_cm * filter_->state().P(from, place[static_cast<std::size_t>(j)]);
  }
  step.belief.x.head<3>() += origin_in_world_;
  return step;
}

TrackStep XiahouTracker::take(const TargetObservation& observation) {
  constexpr double together_s = 0.06;
  TrackStep step;
  if (filter_) step = step_now();
  step.accepted = false;
  if (observation.head >= 2) return step;
  last_[observation.head] = observation;
  if (!last_[0] || !last_[1] || !(std::abs(last_[0]->t_capture_s - last_[1]->t_capture_s) <= together_s)) return step;
  std::array<std::optional<Eigen::Vector2d>, 2> angles{last_[0]->pan_tilt_rad, last_[1]->pan_tilt_rad};
  for (std::size_t i = 0; i < 2 && config_.use_pixels; ++i) angles[i] = angles_of_ray(heads_[i], *last_[i]);
  const double t_s = std::max(last_[0]->t_capture_s, last_[1]->t_capture_s);
  const auto k =
      angles[0] && angles[1] ? pseudo_measurement(*angles[0], *angles[1], config_.baseline_cm) : std::nullopt;
  if (!k || (filter_ && !(t_s > filter_time_s_))) return step;
  const bool starts = !filter_;
  if (starts) filter_.emplace(config_, position_of_pseudo_measurement(*k, config_.baseline_cm));
  if (!starts) filter_->step(*k, t_s - filter_time_s_);
  filter_time_s_ = t_s;
  last_ = {};
  step = step_now();
  if (starts) step.event = TrackEvent::start;
  return step;
}

}  // namespace alidade
