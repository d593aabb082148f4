#pragma once

#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "alidade/geometry/so3.h"
#include "alidade/network/moving_target.h"

/// Fixed cameras that watch one target.
namespace alidade::testing {

using PathOf = Eigen::Vector3d (*)(double t_s);

/// Over a field of 30 m, up to 8 m/s.
inline Eigen::Vector3d loops(double t_s) {
  return {12.0 * std::sin(0.37 * t_s), -6.0 + 4.0 * std::sin(0.53 * t_s + 1.0), 30.0 + 10.0 * std::cos(0.29 * t_s)};
}
/// Along a line.
inline Eigen::Vector3d straight(double t_s) { return {-12.0 + 0.6 * t_s, -6.0, 30.0}; }

struct MovingScene {
  std::vector<RigHead> truth;
  std::vector<double> offset_s, rate;  ///< Time of the camera = offset + rate · true time.
  std::vector<TargetObservation> observations;
};

inline Rigid3 looking(const Eigen::Vector3d& from, const Eigen::Vector3d& at) {
  const Eigen::Vector3d z = (at - from).normalized(), x = Eigen::Vector3d(0.0, 1.0, 0.0).cross(z).normalized();
  Eigen::Matrix3d R;
  R << x, z.cross(x), z;
  return {Eigen::Quaterniond(R), from};
}

/// Cameras of f 800 px at the edge of the field; 25, 30 and 50 images a second for 40 s.
inline MovingScene scene_of(PathOf path, unsigned seed, bool clocks_differ, double sigma_px = 0.5) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, sigma_px);
  MovingScene scene;
  const std::array<Eigen::Vector3d, 3> places{Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(20, -1, 5),
                                              Eigen::Vector3d(-18, 1, 12)};
  const std::array<double, 3> rates_hz{25.0, 30.0, 50.0};
  for (std::size_t c = 0; c < 3; ++c) {
    RigHead head;
    head.head.id = static_cast<int>(c + 1);
    head.head.world_from_base = looking(places[c], {0.3 * static_cast<double>(c), -5.0, 30.0});
    head.camera.width_px = 1920;
    head.camera.height_px = 1080;
    Calibrated<Pinhole> lens;
    lens.params.head<4>() = Eigen::Vector4d(800.0, 800.0, 960.0, 540.0);
    head.camera.lens = lens;
    scene.truth.push_back(head);
    scene.offset_s.push_back(clocks_differ ? std::array{0.0, 1.37, -0.83}[c] : 0.0);
    scene.rate.push_back(clocks_differ ? std::array{1.0, 1.0004, 0.9994}[c] : 1.0);
    for (double t_s = 0.001 * static_cast<double>(c); t_s < 40.0; t_s += 1.0 / rates_hz[c]) {
      const auto seen = project(head, Eigen::Vector2d::Zero(), path(t_s));
      if (!seen) continue;
      const Eigen::Vector2d px = seen->px + Eigen::Vector2d(noise(random), noise(random));
      if (px.x() < 0.0 || px.y() < 0.0 || px.x() > 1919.0 || px.y() > 1079.0) continue;
      const double own_s = scene.offset_s[c] + scene.rate[c] * t_s;
      scene.observations.push_back({own_s, own_s, c, Eigen::Vector2d::Zero(), px, 0.0});
    }
  }
  return scene;
}

/// The heads as a person gives them: lenses alone.
inline std::vector<RigHead> unplaced(const MovingScene& scene) {
  std::vector<RigHead> heads = scene.truth;
  for (RigHead& head : heads) {
    head.head.world_from_base = Rigid3{};
    head.camera.cov.setZero(5, 5);  // exact
  }
  return heads;
}

inline KnownDistance true_distance(const MovingScene& scene) {
  return {1, 2,
          (scene.truth[0].head.world_from_base.translation - scene.truth[1].head.world_from_base.translation).norm(),
          1e-3};
}

/// Of camera c in the first camera's frame: [translation; rotation], estimate against truth, on the right.
inline Eigen::Matrix<double, 6, 1> error_of(const MovingTargetReport& report, const MovingScene& scene, std::size_t c) {
  const auto first_from = [&](const std::vector<RigHead>& heads) {
    return heads[0].head.world_from_base.inverse() * heads[c].head.world_from_base;
  };
  const Rigid3 difference = first_from(scene.truth).inverse() * first_from(report.rig.heads);
  Eigen::Matrix<double, 6, 1> xi;
  xi << difference.translation, log_so3(difference.rotation);
  return xi;
}

}  // namespace alidade::testing
