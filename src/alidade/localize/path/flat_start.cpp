#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <utility>

#include "alidade/estimation/median.h"
#include "alidade/localize/path/path_resection.h"
#include "alidade/localize/path/path_smoother.h"

namespace alidade {
namespace {

struct Supposed {
  Eigen::Vector3d point_in_world;
  Eigen::Matrix3d cov;  ///< Along the ray.
};
using SupposedMap = std::map<long, Supposed>;

double median_of_depths(const Rigid3& world_from_cam, std::span<const PlacedObservation> placed, double otherwise) {
  std::vector<double> depths;
  for (const PlacedObservation& each : placed) {
    const double depth = (world_from_cam.inverse() * each.point_in_world).z();
    if (depth > 0.0) depths.push_back(depth);
  }
  return depths.empty() ? otherwise : median_of(std::move(depths));
}

void suppose(const Camera& camera, const Rigid3& world_from_cam, const UsedObservation& observation, double depth_m,
             SupposedMap& map) {
  constexpr double sigma_rel = 0.3, min_z = 0.2;  // at the edge of a wide lens a depth is no distance
  const auto ray_in_cam = unproject(camera, observation.px);
  if (!ray_in_cam) return;
  const double range_m = depth_m / std::max(ray_in_cam->z(), min_z), sigma_m = sigma_rel * range_m;
  const Eigen::Vector3d ray_in_world = world_from_cam.rotation * *ray_in_cam;
  map[observation.id] = {world_from_cam.translation + range_m * ray_in_world,
                         sigma_m * sigma_m * ray_in_world * ray_in_world.transpose()};
}

}  // namespace

std::optional<SmootherProblem> flat_start(const SmootherProblem& problem) {
  SmootherProblem flat = problem;
  SupposedMap map;
  Rigid3 world_from_cam = problem.world_from_cam.front();
  double depth_m = 1.0;
  for (const SmootherPoint& point : problem.points)
    if (point.range && point.first_frame == 0) depth_m = point.range->range_m;
  auto from = flat.observations.begin();
  for (std::size_t k = 0; k < flat.world_from_cam.size(); ++k) {
    const auto end = std::find_if(from, flat.observations.end(), [k](const auto& each) { return each.frame != k; });
    std::vector<PlacedObservation> placed;
    for (auto it = from; it != end; ++it) {
      it->fits_start = true;
      if (const auto at = map.find(it->id); at != map.end())
        placed.push_back({it->px, it->sigma_px, at->second.point_in_world, at->second.cov});
    }
    if (k > 0) {
      const auto found = resection(problem.camera, placed, {&world_from_cam, 1}, 4.0 * problem.filter.gate);
      if (!found) return std::nullopt;
      world_from_cam = found->world_from_cam;
      depth_m = median_of_depths(world_from_cam, placed, depth_m);
    }
    flat.world_from_cam[k] = world_from_cam;
    for (; from != end; ++from)
      if (!map.contains(from->id)) suppose(problem.camera, world_from_cam, *from, depth_m, map);
  }
  for (SmootherPoint& point : flat.points) {
    const auto at = map.find(point.id);
    if (at == map.end()) return std::nullopt;
    point.point_in_world = at->second.point_in_world;
  }
  return flat;
}

double cost_of(const SmoothedPath& path, double gate, CostBy by) {
  double cost = gate * static_cast<double>(path.num_dropped);
  for (const PlacedResidual& each : path.residuals) {
    const double sigma_px = by == CostBy::found_sigma ? each.error_factor * each.sigma_px : each.sigma_px;
    cost += each.residual_px.squaredNorm() / (sigma_px * sigma_px);
  }
  return cost;
}

}  // namespace alidade
