#include "alidade/pantilt/target_observation.h"

#include <algorithm>
#include <array>
#include <span>

namespace alidade {

std::optional<WorldRay> ray_in_world(const RigHead& rig_head, const TargetObservation& observation) {
  const Eigen::Vector2d own_px =
      observation.lens ? Zoomed(rig_head.camera, observation.lens->k).own_px(observation.px) : observation.px;
  return ray_in_world(rig_head, observation.pan_tilt_rad, own_px);
}

namespace {

/// Lagrange's weights of four times at one between the second and the third; none where a spacing is more than twice
/// another, as beside a gap.
std::optional<Eigen::Vector4d> cubic_weights(std::span<const double, 4> t_s, double time_s) {
  constexpr double most = 2.0;
  const std::array<double, 3> apart{t_s[1] - t_s[0], t_s[2] - t_s[1], t_s[3] - t_s[2]};
  const auto [least, widest] = std::ranges::minmax(apart);
  if (!(widest <= most * least)) return std::nullopt;
  Eigen::Vector4d weights = Eigen::Vector4d::Ones();
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t k = 0; k < 4; ++k)
      if (k != i) weights[static_cast<Eigen::Index>(i)] *= (time_s - t_s[k]) / (t_s[i] - t_s[k]);
  return weights;
}

}  // namespace

std::optional<Eigen::Vector3d> TrueTrack::at(double time_s) const {
  constexpr double slack_s = 1e-9;
  if (t_s.empty() || !(time_s >= t_s.front() - slack_s) || !(time_s <= t_s.back() + slack_s)) return std::nullopt;
  const auto after = std::ranges::lower_bound(t_s, time_s);
  const auto i = static_cast<std::size_t>(after - t_s.begin());
  if (i == 0) return position.front();
  if (i == t_s.size()) return position.back();
  if (i > 1 && i + 1 < t_s.size()) {
    const auto weights = cubic_weights(std::span(t_s).subspan(i - 2).first<4>(), time_s);
    if (weights) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (std::size_t k = 0; k < 4; ++k) sum += (*weights)[static_cast<Eigen::Index>(k)] * position[i - 2 + k];
      return sum;
    }
  }
  const double share = (time_s - t_s[i - 1]) / (t_s[i] - t_s[i - 1]);
  return Eigen::Vector3d((1.0 - share) * position[i - 1] + share * position[i]);
}

}  // namespace alidade
