#include "alidade/localize/path/remaining_points.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <unordered_map>

#include "alidade/geometry/decompositions.h"
#include "alidade/localize/filter/observation_record.h"

namespace alidade {
namespace {

constexpr std::size_t min_looks = 3;

/// An observation of a point from a smoothed pose.
struct Look {
  std::size_t frame = 0;  ///< Of the smoothed path.
  Eigen::Vector2d px;
  double sigma_px = 0.5;
};

/// The point closest to all rays in the least-squares sense. Empty if they are parallel.
std::optional<Eigen::Vector3d> nearest_to_rays(const SmoothedPath& smoothed, std::span<const Look> looks) {
  Eigen::Matrix3d across = Eigen::Matrix3d::Zero();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Look& look : looks) {
    const auto ray = unproject(smoothed.camera, look.px);
    if (!ray) continue;
    const Rigid3& pose = smoothed.world_from_cam[look.frame];
    const Eigen::Vector3d direction = (pose.rotation * *ray).normalized();
    const Eigen::Matrix3d off = Eigen::Matrix3d::Identity() - direction * direction.transpose();
    across += off;
    sum += off * pose.translation;
  }
  const Ldlt ldlt(across);
  constexpr double min_angle2 = 1e-5;  // squared angle between rays
  if (!(ldlt.min_pivot() > min_angle2 * static_cast<double>(looks.size()))) return std::nullopt;
  return ldlt.solve(sum);
}

struct PlacedPoint {
  Eigen::Vector3d point_in_world;
  Eigen::Matrix3d cov;
  std::size_t num_fit = 0;
};

/// One Gauss–Newton step from `at`, with the observations within the gate; `gate` ∞: with all.
std::optional<PlacedPoint> placed_from(const SmoothedPath& smoothed, std::span<const Look> looks,
                                       const Eigen::Vector3d& at, double gate) {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  Eigen::Matrix3d of_poses = Eigen::Matrix3d::Zero();
  PlacedPoint placed;
  for (const Look& look : looks) {
    const Rigid3& pose = smoothed.world_from_cam[look.frame];
    const Eigen::Vector3d point_in_cam = pose.inverse() * at;
    const auto seen = project_with_jacobians(smoothed.camera, point_in_cam);
    if (!seen) continue;
    const Eigen::Vector2d residual_px = look.px - seen->px;
    const double variance = look.sigma_px * look.sigma_px;
    if (residual_px.squaredNorm() > gate * variance) continue;
    const Eigen::Matrix3d R = pose.rotation.toRotationMatrix();
    const Eigen::Matrix<double, 2, 3> J = seen->J_px_point * R.transpose();
    H += J.transpose() * J / variance;
    g += J.transpose() * residual_px / variance;
    Eigen::Matrix<double, 3, 6> J_pose;  // derivative of a point that is rigidly attached to the camera
    J_pose << R, -R * cross_matrix(point_in_cam);
    of_poses += J_pose * smoothed.cov[look.frame] * J_pose.transpose();
    ++placed.num_fit;
  }
  const Llt llt(H);
  if (placed.num_fit < min_looks || !llt.is_positive()) return std::nullopt;
  placed.point_in_world = at + llt.solve(g);
  placed.cov = llt.inverse() + of_poses / static_cast<double>(placed.num_fit);
  if (!placed.point_in_world.allFinite() || !placed.cov.allFinite()) return std::nullopt;
  return placed;
}

std::optional<PlacedPoint> placed_by(const SmoothedPath& smoothed, std::span<const Look> looks, double gate) {
  const auto begin = nearest_to_rays(smoothed, looks);
  if (!begin) return std::nullopt;
  constexpr int num_steps = 4;
  std::optional<PlacedPoint> placed = PlacedPoint{*begin, {}, 0};
  for (int i = 0; i < num_steps && placed; ++i) {
    const double widened = i == 0 ? 1e6 : i == 1 ? 16.0 : 1.0;
    placed = placed_from(smoothed, looks, placed->point_in_world, widened * gate);
  }
  if (!placed || 2 * placed->num_fit < looks.size()) return std::nullopt;
  return placed;
}

/// Observations of all points of a problem, and of those that no position fits, marked by whether they fit a path.
std::vector<UsedObservation> all_observations(const SmoothedPath& smoothed, std::span<const ObservationFrame> frames,
                                              const SmootherProblem& problem, const std::set<long>& misfits) {
  const double gate = 4.0 * problem.filter.gate;  // wide: poses and positions still change in the joint solve
  std::vector<UsedObservation> all;
  for (std::size_t k = 0; k < smoothed.world_from_cam.size(); ++k) {
    const Rigid3 cam_from_world = smoothed.world_from_cam[k].inverse();
    for (const FeatureObservation& each : frames[k].observations) {
      const auto point = std::ranges::lower_bound(problem.points, each.id, {}, &SmootherPoint::id);
      const bool is_there = point != problem.points.end() && point->id == each.id;
      if (!is_there && !misfits.contains(each.id)) continue;
      const double sigma_px = each.sigma_px > 0.0 ? each.sigma_px : problem.filter.sigma_px;
      const auto px = is_there ? project(smoothed.camera, cam_from_world * point->point_in_world) : std::nullopt;
      const bool fits = px && (*px - each.px).squaredNorm() <= gate * sigma_px * sigma_px;
      all.push_back({k, each.id, each.px, sigma_px, fits});
    }
  }
  return all;
}

/// Removes points that most of their observations do not fit: they were estimated with another path or lens.
void drop_misplaced(const SmoothedPath& smoothed, std::span<const ObservationFrame> frames, SmootherProblem& problem) {
  std::unordered_map<long, std::size_t> num_fit, num_seen;
  for (const PlacedResidual& residual : smoothed.residuals) ++num_fit[residual.id];
  for (std::size_t k = 0; k < smoothed.world_from_cam.size(); ++k)
    for (const FeatureObservation& each : frames[k].observations) ++num_seen[each.id];
  std::erase_if(problem.points, [&](const SmootherPoint& point) {
    return !point.given_in_world && 2 * num_fit[point.id] < num_seen[point.id];
  });
}

}  // namespace

void add_remaining(const SmoothedPath& smoothed, std::span<const ObservationFrame> frames, SmootherProblem& problem) {
  drop_misplaced(smoothed, frames, problem);
  std::map<long, std::vector<Look>> looks;
  for (std::size_t k = 0; k < smoothed.world_from_cam.size(); ++k)
    for (const FeatureObservation& each : frames[k].observations)
      if (!std::ranges::binary_search(problem.points, each.id, {}, &SmootherPoint::id))
        looks[each.id].push_back({k, each.px, each.sigma_px > 0.0 ? each.sigma_px : problem.filter.sigma_px});
  std::vector<SmootherPoint> added;
  std::set<long> misfits;
  for (const auto& [id, of_point] : looks) {
    if (of_point.size() < min_looks || !nearest_to_rays(smoothed, of_point)) continue;
    const auto placed = placed_by(smoothed, of_point, problem.filter.gate);
    if (placed)
      added.push_back({.id = id, .point_in_world = placed->point_in_world, .given_in_world = {}, .range = {}});
    else
      misfits.insert(id);
  }
  if (static_cast<double>(problem.points.size() + added.size()) > max_points_at_once(smoothed.world_from_cam.size()))
    return;
  problem.points.insert(problem.points.end(), added.begin(), added.end());
  std::ranges::sort(problem.points, {}, &SmootherPoint::id);
  problem.observations = all_observations(smoothed, frames, problem, misfits);
}

void locate_remaining(const SmoothedPath& smoothed, std::size_t first_frame, std::span<const ObservationFrame> frames,
                      double sigma_px, double gate, std::vector<MapPoint>& map) {
  std::unordered_map<long, std::vector<Look>> looks;
  for (const MapPoint& point : map)
    if (!point.is_known && !std::ranges::binary_search(smoothed.ids, point.id)) looks[point.id];
  for (std::size_t k = 0; k < smoothed.world_from_cam.size() && first_frame + k < frames.size(); ++k)
    for (const FeatureObservation& observation : frames[first_frame + k].observations)
      if (const auto at = looks.find(observation.id); at != looks.end())
        at->second.push_back({k, observation.px, observation.sigma_px > 0.0 ? observation.sigma_px : sigma_px});
  for (MapPoint& point : map) {
    const auto at = looks.find(point.id);
    if (at == looks.end() || at->second.size() < min_looks) continue;
    const auto placed = placed_by(smoothed, at->second, gate);
    if (!placed) continue;
    point.point_in_world = placed->point_in_world;
    point.cov = placed->cov;
  }
}

}  // namespace alidade
