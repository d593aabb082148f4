#include "alidade/simulate/turned_scene.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>

#include "alidade/geometry/so3.h"
#include "alidade/simulate/draws.h"

namespace alidade {
namespace {

struct TurnedView {
  Eigen::Matrix3d cam_from_world;
  Eigen::Vector3d centre_m;
  double zoom = 1.0;
};

std::vector<TurnedView> views_of(const TurnedScene& scene, Draws& draws) {
  std::vector<TurnedView> views;
  for (int k = 0; k < scene.num_photos; ++k) {
    const Eigen::Vector3d shake = scene.shake_rad * draws.normal3();
    const double tilt = scene.tilt_rad * (k % 3 - 1);
    // y points down: a pan about it, then a tilt about the camera's x, then the hand's shake
    const Eigen::Quaterniond turn = exp_so3(shake) * exp_so3(Eigen::Vector3d(tilt, 0.0, 0.0)) *
                                    exp_so3(Eigen::Vector3d(0.0, scene.pan_step_rad * k, 0.0));
    TurnedView view{turn.toRotationMatrix(), {}, 1.0};
    view.centre_m = view.cam_from_world.transpose() * scene.lever_m + scene.sigma_step_m * draws.normal3();
    if (static_cast<std::size_t>(k) < scene.zoom.size()) view.zoom = scene.zoom[static_cast<std::size_t>(k)];
    views.push_back(view);
  }
  return views;
}

std::optional<Eigen::Vector2d> pixel_of(const TurnedScene& scene, const TurnedView& view,
                                        const Eigen::Vector3d& point) {
  const Eigen::Vector3d Y = view.cam_from_world * (point - view.centre_m);
  if (!(Y.z() > 0.1 * Y.norm())) return std::nullopt;
  const Eigen::Vector2d x = Y.head<2>() / Y.z();
  const double r2 = x.squaredNorm();
  if (!(1.0 + r2 * (3.0 * scene.k1 + r2 * (5.0 * scene.k2 + 7.0 * scene.k3 * r2)) > 0.0)) return std::nullopt;
  const double d = 1.0 + r2 * (scene.k1 + r2 * (scene.k2 + r2 * scene.k3)), xy = 2.0 * x.x() * x.y();
  const double u = d * x.x() + scene.p1 * xy + scene.p2 * (r2 + 2.0 * x.x() * x.x());
  const double v = d * x.y() + scene.p1 * (r2 + 2.0 * x.y() * x.y()) + scene.p2 * xy;
  const Eigen::Vector2d px(view.zoom * scene.fx * u + scene.cx, view.zoom * scene.fy * v + scene.cy);
  const bool inside = px.x() > 0.0 && px.y() > 0.0 && px.x() < scene.width_px - 1 && px.y() < scene.height_px - 1;
  return inside ? std::optional(px) : std::nullopt;
}

Eigen::Vector3d far_point(const TurnedScene& scene, Draws& draws) {
  const double depth = draws.uniform(scene.min_depth_m, scene.max_depth_m);
  return depth * draws.normal3().normalized();
}

}  // namespace

std::vector<Eigen::Quaterniond> turned_attitudes(const TurnedScene& scene, std::uint64_t seed) {
  Draws draws(seed);
  std::vector<Eigen::Quaterniond> attitudes;
  for (const TurnedView& view : views_of(scene, draws)) attitudes.emplace_back(view.cam_from_world);
  return attitudes;
}

MatchedPhotos simulate_turned_photos(const TurnedScene& scene, std::uint64_t seed) {
  Draws draws(seed);
  MatchedPhotos photos{scene.width_px, scene.height_px, {}, {}, {}};
  const std::vector<TurnedView> views = views_of(scene, draws);
  const auto count = static_cast<std::size_t>(scene.num_photos);
  photos.features.resize(count);
  std::vector<std::map<int, int>> feature_of(count);  // point → feature
  for (std::size_t k = 0; k < count; ++k) photos.names.push_back(fmt::format("photo{:03}.jpg", k + 1));
  const int num_points = static_cast<int>(4.0 * std::numbers::pi * scene.points_per_rad2);
  for (int i = 0; i < num_points; ++i) {
    const Eigen::Vector3d point = far_point(scene, draws);
    const bool moves = draws.uniform() < scene.moving_share;
    for (std::size_t k = 0; k < count; ++k) {
      constexpr double wander = 0.02;  // of the distance
      const Eigen::Vector3d now = moves ? Eigen::Vector3d(point + wander * point.norm() * draws.normal3()) : point;
      const auto px = pixel_of(scene, views[k], now);
      if (!px) continue;
      feature_of[k][i] = static_cast<int>(photos.features[k].size());
      photos.features[k].emplace_back(*px + scene.sigma_px * draws.normal2());
    }
  }
  constexpr std::size_t min_matches = 10;
  for (std::size_t a = 0; a < count; ++a) {
    for (std::size_t b = a + 1; b < count; ++b) {
      MatchedPair pair{static_cast<int>(a), static_cast<int>(b), {}};
      for (const auto& [point, feature] : feature_of[a]) {
        const auto in_b = feature_of[b].find(point);
        if (in_b == feature_of[b].end() || draws.uniform() >= scene.found_share) continue;
        int other = in_b->second;
        if (draws.uniform() < scene.wrong_share)
          other = static_cast<int>(draws.uniform() * static_cast<double>(photos.features[b].size()));
        pair.matches.push_back({feature, other});
      }
      if (pair.matches.size() >= min_matches) photos.pairs.push_back(std::move(pair));
    }
  }
  return photos;
}

}  // namespace alidade
