#include "alidade/pantilt/target_observation.h"

#include <algorithm>

namespace alidade {

std::optional<WorldRay> ray_in_world(const RigHead& rig_head, const TargetObservation& observation) {
  const Eigen::Vector2d own_px =
      observation.lens ? Zoomed(rig_head.camera, observation.lens->k).own_px(observation.px) : observation.px;
  return ray_in_world(rig_head, observation.pan_tilt_rad, own_px);
}

std::optional<Eigen::Vector3d> TrueTrack::at(double time_s) const {
  constexpr double slack_s = 1e-9;
  if (t_s.empty() || !(time_s >= t_s.front() - slack_s) || !(time_s <= t_s.back() + slack_s)) return std::nullopt;
  const auto after = std::ranges::lower_bound(t_s, time_s);
  const auto i = static_cast<std::size_t>(after - t_s.begin());
  if (i == 0) return position.front();
  if (i == t_s.size()) return position.back();
  const double share = (time_s - t_s[i - 1]) / (t_s[i] - t_s[i - 1]);
  return Eigen::Vector3d((1.0 - share) * position[i - 1] + share * position[i]);
}

}  // namespace alidade
