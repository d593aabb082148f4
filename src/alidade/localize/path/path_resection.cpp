#include "alidade/localize/path/path_resection.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/three_point_pose.h"

namespace alidade {
namespace {

struct PlacedView {
  Eigen::Vector2d residual_px;
  Eigen::Matrix<double, 2, 6> J;
  double variance_px2 = 0.0;  ///< Of pixel and position together, mean of both coordinates.
};

std::optional<PlacedView> placed_view(const Camera& camera, const Rigid3& world_from_cam,
                                      const PlacedObservation& observation) {
  Feature feature;
  feature.values.head<3>() = observation.point_in_world;
  const auto view = expected_view(camera, world_from_cam, feature);
  if (!view) return std::nullopt;
  const Eigen::Matrix<double, 2, 3> J_point = view->J_px_feature.leftCols<3>();
  const double of_place = 0.5 * (J_point * observation.cov * J_point.transpose()).trace();
  return PlacedView{observation.px - view->px, view->J_px_pose, observation.sigma_px * observation.sigma_px + of_place};
}

CameraResection judged(const Camera& camera, std::span<const PlacedObservation> observations,
                       const Rigid3& world_from_cam, double gate) {
  CameraResection resection{world_from_cam, 0.0, 0, {}};
  for (const PlacedObservation& observation : observations) {
    const auto view = placed_view(camera, world_from_cam, observation);
    const double chi2 = view ? view->residual_px.squaredNorm() / view->variance_px2 : gate;
    resection.fits.push_back(view && chi2 <= gate);
    resection.num_fit += resection.fits.back() ? 1 : 0;
    resection.cost += std::min(chi2, gate);
  }
  return resection;
}

/// One Gauss–Newton step with robust weights of width `wide_px`. False if the pose is not determined.
bool stepped(const Camera& camera, std::span<const PlacedObservation> observations, double wide_px,
             Rigid3& world_from_cam) {
  Eigen::Matrix<double, 6, 6> H = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Vector<double, 6> g = Eigen::Vector<double, 6>::Zero();
  for (const PlacedObservation& observation : observations) {
    const auto view = placed_view(camera, world_from_cam, observation);
    if (!view) continue;
    const double wide2 = std::max(wide_px * wide_px, 6.0 * view->variance_px2);
    const double robust = wide2 / (wide2 + view->residual_px.squaredNorm());
    const double weight = robust * robust / view->variance_px2;
    H += weight * view->J.transpose() * view->J;
    g += weight * view->J.transpose() * view->residual_px;
  }
  const Llt llt(H);
  if (!llt.is_positive()) return false;
  const Eigen::Vector<double, 6> step = llt.solve(g);
  if (!step.allFinite()) return false;
  world_from_cam.translation += step.head<3>();
  world_from_cam.rotation = (world_from_cam.rotation * exp_so3(step.tail<3>())).normalized();
  return true;
}

}  // namespace

std::optional<CameraResection> resection(const Camera& camera, std::span<const PlacedObservation> observations,
                                         std::span<const Rigid3> begin_at, double gate, double widest_px) {
  constexpr std::size_t min_observations = 3;
  if (observations.size() < min_observations) return std::nullopt;
  std::optional<CameraResection> best;
  for (const Rigid3& begin : begin_at) {
    Rigid3 world_from_cam = begin;
    constexpr double narrowest_px = 1.0;
    for (double wide_px = widest_px; wide_px >= narrowest_px; wide_px *= 0.6)
      if (!stepped(camera, observations, wide_px, world_from_cam)) break;
    for (const Rigid3& there : {begin, world_from_cam}) {
      CameraResection now = judged(camera, observations, there, gate);
      if (!best || now.cost < best->cost) best = std::move(now);
    }
  }
  return best;
}

std::vector<Rigid3> poses_of_threes(const Camera& camera, std::span<const PlacedObservation> observations,
                                    int num_draws, std::size_t max_poses) {
  constexpr double near_px2 = 8.0 * 8.0;  // three noisy rays predict the others with about this accuracy
  std::vector<PlacedObservation> seen;
  std::vector<Eigen::Vector3d> rays_in_cam;
  for (const PlacedObservation& each : observations) {
    const auto ray = unproject(camera, each.px);
    if (!ray) continue;
    seen.push_back(each);
    rays_in_cam.push_back(*ray);
  }
  if (seen.size() < 3) return {};
  std::mt19937_64 bits(1);
  std::vector<std::pair<double, Rigid3>> scored;
  for (int draw = 0; draw < num_draws; ++draw) {
    const std::size_t a = bits() % seen.size(), b = bits() % seen.size(), c = bits() % seen.size();
    if (a == b || b == c || a == c) continue;
    for (const Rigid3& pose :
         three_point_poses({seen[a].point_in_world, seen[b].point_in_world, seen[c].point_in_world},
                           {rays_in_cam[a], rays_in_cam[b], rays_in_cam[c]})) {
      double score = 0.0;
      for (const PlacedObservation& each : seen) {
        const auto px = project(camera, pose.inverse() * each.point_in_world);
        if (px) score += 1.0 / (1.0 + (*px - each.px).squaredNorm() / near_px2);
      }
      scored.emplace_back(score, pose);
    }
  }
  std::ranges::stable_sort(scored, std::greater{}, [](const auto& each) { return each.first; });
  std::vector<Rigid3> poses;
  for (std::size_t i = 0; i < std::min(scored.size(), max_poses); ++i) poses.push_back(scored[i].second);
  return poses;
}

}  // namespace alidade
