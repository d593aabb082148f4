#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "alidade/geometry/similarity.h"
#include "alidade/localize.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/imu/imu_readings.h"
#include "alidade/simulate/underwater.h"

namespace alidade::testing {

struct ImuRun {
  Camera camera;
  std::vector<ObservationFrame> frames;
  std::vector<TimedPose> truth;
  std::vector<KnownPoint> target;
  ImuScene scene;
  ImuSequence imu;
  ImuMounting given;  ///< Off by its σ.
};

/// A camera that swings before points, with an IMU whose mounting and scale factor are known as well as is said.
inline ImuRun swinging(std::uint64_t seed, ImuScene scene = {}, int num_frames = 300, double dt_s = 1.0 / 30.0) {
  Draws draws(seed + 50);
  scene.force_scale = scene.noise.sigma_force_scale * draws.normal();
  ImuMounting given = scene.mounting;
  given.cam_from_imu.rotation = exp_so3(given.sigma_rotation_rad * draws.normal3()) * given.cam_from_imu.rotation;
  given.cam_from_imu.translation += given.sigma_position_m * draws.normal3();
  UnderwaterScene world;
  world.camera = underwater_camera();
  world.num_points = 60;
  world.num_frames = num_frames;
  world.dt_s = dt_s;
  const UnderwaterSequence sequence = simulate_underwater(world, seed);
  ImuRun run{world.camera, {}, {}, {}, scene, {}, given};
  for (const UnderwaterFrame& frame : sequence.frames) {
    ObservationFrame seen{static_cast<long>(run.frames.size()), frame.t_s, {}};
    for (const UnderwaterObservation& observation : frame.observations)
      seen.observations.push_back({observation.id, observation.px, 0.0});
    run.truth.push_back({frame.t_s, frame.world_from_cam});
    run.frames.push_back(std::move(seen));
  }
  for (const UnderwaterPoint& point : sequence.points)
    if (point.is_known) run.target.push_back({point.id, point.given_in_world, world.sigma_known_m});
  run.imu = simulate_imu(scene, sequence.world_from_cam, -0.5, run.truth.back().t_s + 0.5, seed + 100);
  return run;
}

inline LocalizeConfig with_imu(const ImuRun& run) {
  LocalizeConfig config;
  config.imu = Imu{.readings = run.imu.readings, .mounting = run.given, .noise = run.scene.noise};
  config.imu->gravity_m_s2 = run.scene.gravity_in_world.norm();
  return config;
}

/// Largest error of a position in its σ, once the path stands in the frame of the truth: its scale as found.
inline double worst_sigmas(const Localization& result, const ImuRun& run) {
  std::vector<Eigen::Vector3d> truth, path;
  for (std::size_t k = 0; k < result.path.size(); ++k) {
    truth.push_back(run.truth[k].world_from_cam.translation);
    path.push_back(result.path[k].world_from_cam.translation);
  }
  const auto to_truth = aligned(path, truth, true);
  double worst = 0.0;
  for (std::size_t k = 0; k < path.size(); ++k) {
    const Eigen::Vector3d error = to_truth->b_from_a * path[k] - truth[k];
    worst = std::max(worst, error.norm() / std::sqrt(result.path[k].cov.topLeftCorner<3, 3>().trace()));
  }
  return worst;
}

}  // namespace alidade::testing
