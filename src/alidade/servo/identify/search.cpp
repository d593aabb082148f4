#include "alidade/servo/identify/search.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace alidade {

Eigen::Vector2d TargetSearch::at(double t_s) const {
  const double since_s = std::max(0.0, t_s - begin_s_);
  const double carried_s = config_.carry_s > 0.0 ? -config_.carry_s * std::expm1(-since_s / config_.carry_s) : 0.0;
  const Eigen::Vector2d centre(lost_[0].angle_rad + lost_[0].rate_rad_s * carried_s,
                               lost_[1].angle_rad + lost_[1].rate_rad_s * carried_s);
  // For r = turn φ / 2π the arc length is about turn φ² / 4π.
  const double max_turns = config_.max_radius_rad / turn_rad_;
  const double whole_arc = std::numbers::pi * turn_rad_ * max_turns * max_turns;
  const double arc = std::fmod(config_.speed_rad_s * since_s, std::max(whole_arc, turn_rad_));
  const double phi = std::sqrt(4.0 * std::numbers::pi * arc / turn_rad_);
  const double radius = turn_rad_ * phi / (2.0 * std::numbers::pi);
  // A rotation about the pan axis moves the view by cos(tilt) times its angle.
  const double shrink = std::max(0.2, std::cos(centre.y()));
  return centre + radius * Eigen::Vector2d(std::cos(phi) / shrink, std::sin(phi));
}

}  // namespace alidade
