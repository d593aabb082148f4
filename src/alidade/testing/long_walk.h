#pragma once

#include <cmath>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/localize/sequence.h"
#include "alidade/localize/target.h"
#include "alidade/simulate/draws.h"

namespace alidade::testing {

/// A camera that walks along a wall, past many numbered points of which it sees about a fifth at a time; the first
/// points are the target.
struct LongWalk {
  int num_points = 500, num_frames = 900;
  double length_m = 6.0, dt_s = 1.0 / 30.0, sigma_px = 0.5;
  double sigma_known_m = 0.0;  ///< By how much the target's points are given wrongly.
  double rise_m = 0.05;        ///< Up and down.
  bool is_wall = false;        ///< The points are on a wall that is not quite flat.
  bool comes_back = false;     ///< Half of the frames there, half of them back.
};

struct WalkRun {
  Camera camera;
  std::vector<ObservationFrame> frames;
  std::vector<TimedPose> truth;
  std::vector<KnownPoint> target;
  std::vector<Eigen::Vector3d> points;  ///< By number.
};

inline double wall_z(double x, double y) { return 1.5 + 0.1 * std::sin(2.0 * x) + 0.05 * std::cos(3.0 * y); }

inline WalkRun long_walk(const LongWalk& scene, std::uint64_t seed) {
  Draws draws(seed);
  WalkRun run;
  Calibrated<Brown> lens;
  lens.params << 610.0, 612.0, 386.0, 286.0, 0.0, -0.25, 0.08, 0.001, -0.0007, 0.0;
  run.camera.width_px = 768;
  run.camera.height_px = 576;
  run.camera.lens = lens;
  std::vector<Eigen::Vector3d> points{{-0.15, -0.1, 1.2}, {0.15, -0.1, 1.2}, {0.15, 0.1, 1.2},
                                      {-0.15, 0.1, 1.2},  {0.05, 0.0, 1.2},  {-0.05, 0.05, 1.2}};
  for (std::size_t i = 0; i < points.size(); ++i) run.target.push_back({static_cast<long>(i), points[i], 0.001});
  if (scene.sigma_known_m > 0.0)
    for (KnownPoint& given : run.target) given.point_in_world += scene.sigma_known_m * draws.normal3();
  for (int i = 0; i < scene.num_points; ++i) {
    const double x = draws.uniform(-1.0, scene.length_m + 1.0), y = draws.uniform(-0.8, 0.8);
    points.emplace_back(x, y, scene.is_wall ? wall_z(x, y) : draws.uniform(1.0, 2.2));
  }
  for (int k = 0; k < scene.num_frames; ++k) {
    const double t_s = k * scene.dt_s, share = static_cast<double>(k) / (scene.num_frames - 1);
    const double along = scene.comes_back ? 1.0 - std::abs(2.0 * share - 1.0) : share;
    const double x = scene.length_m * 0.5 * (1.0 - std::cos(std::acos(-1.0) * along));  // begins and ends at rest
    const Rigid3 world_from_cam{
        exp_so3(Eigen::Vector3d(0.05 * std::sin(1.1 * t_s), 0.08 * std::sin(0.7 * t_s), 0.04 * std::sin(0.9 * t_s))),
        {x, scene.rise_m * std::sin(0.8 * t_s), 0.06 * std::sin(0.5 * t_s)}};
    ObservationFrame frame{k, t_s, {}};
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d point_in_cam = world_from_cam.inverse() * points[i];
      const Eigen::Vector2d noise_px = scene.sigma_px * draws.normal2();
      const auto px = point_in_cam.z() > 0.1 ? project(run.camera, point_in_cam) : std::nullopt;
      if (!px || px->minCoeff() < 0.0 || px->x() > 767.0 || px->y() > 575.0) continue;
      frame.observations.push_back({static_cast<long>(i), *px + noise_px, 0.0});
    }
    run.frames.push_back(std::move(frame));
    run.truth.push_back({t_s, world_from_cam});
  }
  run.points = points;
  return run;
}

}  // namespace alidade::testing
