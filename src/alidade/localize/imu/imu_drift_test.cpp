#include <gtest/gtest.h>

#include "alidade/geometry/similarity.h"
#include "alidade/localize.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/imu/imu_readings.h"
#include "alidade/simulate/underwater.h"

// An IMU whose biases drift, or whose clock runs fast.

namespace alidade {
namespace {

struct DriftRun {
  Camera camera;
  std::vector<ObservationFrame> frames;
  std::vector<TimedPose> truth;
  Imu imu;
};

/// A camera that swings before points for 16 s; the mounting and the scale factor are off by their σ.
DriftRun recorded(std::uint64_t seed) {
  Draws draws(seed + 70);
  ImuScene scene;
  scene.force_scale = scene.noise.sigma_force_scale * draws.normal();
  UnderwaterScene world;
  world.camera = underwater_camera();
  world.num_points = 60;
  world.num_frames = 320;
  world.dt_s = 1.0 / 20.0;
  const UnderwaterSequence sequence = simulate_underwater(world, seed);
  DriftRun run{world.camera, {}, {}, {}};
  for (const UnderwaterFrame& frame : sequence.frames) {
    ObservationFrame seen{static_cast<long>(run.frames.size()), frame.t_s, {}};
    for (const UnderwaterObservation& observation : frame.observations)
      seen.observations.push_back({observation.id, observation.px, 0.0});
    run.truth.push_back({frame.t_s, frame.world_from_cam});
    run.frames.push_back(std::move(seen));
  }
  ImuMounting given = scene.mounting;
  given.cam_from_imu.rotation = exp_so3(given.sigma_rotation_rad * draws.normal3()) * given.cam_from_imu.rotation;
  given.cam_from_imu.translation += given.sigma_position_m * draws.normal3();
  run.imu = {
      .readings = simulate_imu(scene, sequence.world_from_cam, -0.5, run.truth.back().t_s + 0.5, seed + 100).readings,
      .mounting = given,
      .noise = scene.noise};
  run.imu.gravity_m_s2 = scene.gravity_in_world.norm();
  return run;
}

struct Drifted {
  Localization result;
  double worst = 0.0;  ///< Largest error of a position over its σ, once the path stands in the frame of the truth.
};

Drifted localized(const DriftRun& run) {
  LocalizeConfig config;
  config.imu = run.imu;
  Drifted drifted{localize(run.frames, run.camera, config, run.truth)};
  std::vector<Eigen::Vector3d> truth, path;
  for (std::size_t k = 0; k < run.truth.size(); ++k) {
    truth.push_back(run.truth[k].world_from_cam.translation);
    path.push_back(drifted.result.path[k].world_from_cam.translation);
  }
  const auto to_truth = aligned(path, truth, true);
  for (std::size_t k = 0; k < path.size(); ++k) {
    const double sigma = std::sqrt(drifted.result.path[k].cov.topLeftCorner<3, 3>().trace());
    drifted.worst = std::max(drifted.worst, (to_truth->b_from_a * path[k] - truth[k]).norm() / sigma);
  }
  return drifted;
}

TEST(ImuDrift, OfAnImuAsItShouldBeNothingIsNamed) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const Drifted right = localized(recorded(seed));
    ASSERT_TRUE(right.result.imu);
    EXPECT_EQ(right.result.imu->fault, ImuFault::none) << right.result.verdict.sentence;
    EXPECT_EQ(right.result.imu->rate_walk_factor, 1.0) << seed;
    EXPECT_EQ(right.result.imu->force_walk_factor, 1.0) << seed;
    EXPECT_LT(std::abs(right.result.imu->clock_rate), 4.0 * right.result.imu->sigma_clock_rate) << seed;
    EXPECT_EQ(right.result.verdict.sentence.find("drifts"), std::string::npos) << right.result.verdict.sentence;
    EXPECT_EQ(right.result.verdict.sentence.find("clock runs"), std::string::npos) << right.result.verdict.sentence;
    EXPECT_LT(right.worst, 4.0) << seed;
  }
}

/// An accelerometer that warms up by 0.015 m/s³ bent paths by up to 8σ at ●.
TEST(ImuDrift, ABiasThatDriftsIsEstimatedAndNamed) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    for (const bool is_of_rates : {false, true}) {
      DriftRun run = recorded(seed);
      for (ImuReading& each : run.imu.readings)
        (is_of_rates ? each.rate_rad_s : each.force_m_s2).x() += (is_of_rates ? 0.001 : 0.015) * each.t_s;
      const Drifted drifted = localized(run);
      ASSERT_TRUE(drifted.result.imu);
      ASSERT_EQ(drifted.result.imu->fault, ImuFault::none) << drifted.result.verdict.sentence;
      EXPECT_LT(drifted.worst, 4.5) << seed << is_of_rates;
      EXPECT_NE(drifted.result.verdict.sentence.find(is_of_rates ? "IMU's gyro drifts" : "IMU's accelerometer drifts"),
                std::string::npos)
          << drifted.result.verdict.sentence;
      const Eigen::Vector3d by = is_of_rates ? drifted.result.imu->rate_drift : drifted.result.imu->force_drift;
      EXPECT_NEAR(by.x() / ((is_of_rates ? 0.001 : 0.015) * 16.0), 1.0, 0.3) << seed << is_of_rates;
    }
  }
}

/// 0.3 % fast: 24 ms at either end of 16 s were another lens, other axes, and 8 to 25σ.
TEST(ImuDrift, AClockThatRunsFastIsFoundAndNamed) {
  for (const double rate : {-0.003, 0.001, 0.003}) {
    DriftRun run = recorded(5);
    for (ImuReading& each : run.imu.readings) each.t_s = (1.0 + rate) * each.t_s + 0.02;
    const Drifted fast = localized(run);
    ASSERT_TRUE(fast.result.imu);
    ASSERT_EQ(fast.result.imu->fault, ImuFault::none) << fast.result.verdict.sentence;
    EXPECT_NEAR(fast.result.imu->clock_rate, rate, 4.0 * fast.result.imu->sigma_clock_rate);
    EXPECT_LT(fast.result.imu->sigma_clock_rate, 3e-4);
    EXPECT_LT(fast.worst, 4.0) << rate;
    EXPECT_NE(fast.result.verdict.sentence.find("the IMU's clock runs"), std::string::npos)
        << fast.result.verdict.sentence;
    EXPECT_EQ(fast.result.verdict.sentence.find("lens"), std::string::npos) << fast.result.verdict.sentence;
  }
}

}  // namespace
}  // namespace alidade
