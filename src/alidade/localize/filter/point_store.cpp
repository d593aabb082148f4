#include "alidade/localize/filter/point_store.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "alidade/estimation/median.h"

namespace alidade {

bool PointStore::is_stranger(long id, ObservationOutcome outcome, std::size_t frame) {
  if (outcome != ObservationOutcome::used && outcome != ObservationOutcome::gated) return false;
  Point& point = points_[id];
  const bool is_used = outcome == ObservationOutcome::used;
  point.num_used += is_used ? 1 : 0;
  if (is_used) point.last_frame = frame;
  point.num_gated_in_a_row = is_used ? 0 : point.num_gated_in_a_row + 1;
  constexpr int max_gated = 5;
  const bool is_known = std::ranges::find(config_->target.points, id, &KnownPoint::id) != config_->target.points.end();
  if (is_known || point.num_gated_in_a_row < max_gated) return false;
  point = {};
  point.was_in_map = true;
  gone_.erase(id);
  return true;
}

std::vector<GonePoint> PointStore::gone(const LocalizationFilter& filter) const {
  std::vector<GonePoint> gone;
  for (const auto& [id, point] : gone_)
    if (!filter.has(id)) gone.push_back(point);
  return gone;
}

std::size_t PointStore::last_frame(long id) const {
  const auto at = points_.find(id);
  return at == points_.end() ? 0 : at->second.last_frame;
}

std::size_t PointStore::num_used(long id) const {
  const auto at = points_.find(id);
  return at == points_.end() ? 0 : at->second.num_used;
}

/// Default depth of an unknown point: the median depth of the points of the map.
double PointStore::usual_depth_m(const LocalizationFilter& filter) const {
  if (config_->depth_m) return *config_->depth_m;
  std::vector<double> depths;
  for (const Feature& feature : filter.features()) {
    const double depth = (filter.motion().world_from_cam.inverse() * place_of(feature).point_in_world).z();
    if (depth > 0.0 && (feature.is_known || config_->target.points.empty())) depths.push_back(depth);
  }
  if (depths.empty()) return 1.0;  // world of unknown scale: the first points are one unit away
  return median_of(std::move(depths));
}

/// Null if no depth is given for it.
const GivenDepth* PointStore::given_depth(long id) const {
  if (!config_->start) return nullptr;
  const auto at = std::ranges::find(config_->start->depths, id, &GivenDepth::id);
  return at == config_->start->depths.end() ? nullptr : &*at;
}

/// Range of a point that was in the map, from its last position; σ from those of the point and the camera, at least 5 %
/// because the pose is correlated with the point's earlier observations. Empty: never in the map, or behind the camera.
std::optional<RangePrior> PointStore::known_range(long id, const LocalizationFilter& filter) const {
  const auto at = gone_.find(id);
  if (at == gone_.end()) return std::nullopt;
  const Rigid3& world_from_cam = filter.motion().world_from_cam;
  const Eigen::Vector3d away = at->second.point.point_in_world - world_from_cam.translation;
  const double range_m = away.norm();
  if (!((world_from_cam.inverse() * at->second.point.point_in_world).z() > 0.0)) return std::nullopt;
  const Eigen::Vector3d direction = away / range_m;
  const Eigen::Matrix3d cov = at->second.point.cov + filter.motion_covariance().topLeftCorner<3, 3>();
  constexpr double sure_enough = 0.05, vague = 0.5;
  return RangePrior{range_m, std::clamp(std::sqrt(direction.dot(cov * direction)) / range_m, sure_enough, vague), true};
}

std::optional<RangePrior> PointStore::prior_of(const FeatureObservation& observation,
                                               const LocalizationFilter& filter) {
  if (const auto known = known_range(observation.id, filter)) return known;
  if (config_->new_points == NewPoints::delayed) return triangulated(observation, filter);
  const auto ray_in_cam = unproject(filter.camera(), observation.px);
  if (!ray_in_cam) return std::nullopt;
  const double min_z = 0.05;  // a fisheye also sees sideways, where a depth does not give a distance
  const double z = std::max(ray_in_cam->z(), min_z);
  const GivenDepth* const given = given_depth(observation.id);
  const bool is_new = !std::exchange(points_[observation.id].was_in_map, true);
  if (given != nullptr && is_new) return RangePrior{given->depth_m / z, given->sigma_rel};
  return RangePrior{usual_depth_m(filter) / z, config_->sigma_depth, !config_->depth_m};
}

/// From the rays of the first observation and this one: d = b sin α₁ / sin(parallax), σ_d/d from the σ of the parallax.
std::optional<RangePrior> PointStore::triangulated(const FeatureObservation& observation,
                                                   const LocalizationFilter& filter) {
  const auto ray_in_cam = unproject(filter.camera(), observation.px);
  if (!ray_in_cam) return std::nullopt;
  const Rigid3& world_from_cam = filter.motion().world_from_cam;
  const Eigen::Vector3d ray_in_world = world_from_cam.rotation * *ray_in_cam;
  Point& point = points_[observation.id];
  if (!point.first_world_from_cam) {
    point.first_world_from_cam = world_from_cam;
    point.first_ray_in_world = ray_in_world;
    return std::nullopt;
  }
  const Eigen::Vector3d baseline = world_from_cam.translation - point.first_world_from_cam->translation;
  const double sine = point.first_ray_in_world.cross(ray_in_world).norm();
  const double range_m = baseline.cross(point.first_ray_in_world).norm() / std::max(sine, 1e-12);
  const double focal_px = params(filter.camera().lens)[0];
  // Two pixels, with the variance of each doubled for the pose error accumulated between them.
  const double sigma_angle = 2.0 * std::sqrt(2.0) * filter.config().sigma_px / focal_px;
  const double sigma_rel = sigma_angle / std::max(sine, 1e-12);
  constexpr double sure_enough = 0.05;
  if (!(sigma_rel < sure_enough) || !(range_m > 0.0)) return std::nullopt;
  return RangePrior{range_m, sure_enough, true};  // not below it: the rays are correlated with the pose
}

}  // namespace alidade
