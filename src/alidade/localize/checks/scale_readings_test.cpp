#include "alidade/localize/checks/scale_readings.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <optional>

#include "alidade/localize.h"
#include "alidade/testing/long_walk.h"
#include "alidade/testing/trials.h"

// Metres without a target: a pressure sensor's depths, a rangefinder's readings.

namespace alidade {
namespace {

using testing::long_walk;
using testing::LongWalk;
using testing::WalkRun;

LongWalk swimming() { return {.num_points = 150, .num_frames = 300, .length_m = 2.0, .rise_m = 0.3, .is_wall = true}; }

std::vector<DepthReading> depths_of(const WalkRun& run, double sigma_m, std::uint64_t seed) {
  Draws draws(seed);
  std::vector<DepthReading> readings;
  // Down is a direction of its own in the first camera's frame.
  const Eigen::Vector3d down = Eigen::Vector3d(0.1, 0.97, -0.2).normalized();
  for (const TimedPose& pose : run.truth)
    readings.push_back({pose.t_s, 7.0 + down.dot(pose.world_from_cam.translation) + sigma_m * draws.normal(), sigma_m});
  return readings;
}

Beam beam_beside() {
  Beam beam;
  beam.origin_in_cam = {0.05, 0.02, 0.0};
  beam.direction_in_cam = Eigen::Vector3d(0.02, 0.01, 1.0).normalized();
  return beam;
}

std::vector<RangeReading> ranges_of(const WalkRun& run, const Beam& beam, std::uint64_t seed) {
  Draws draws(seed);
  std::vector<RangeReading> readings;
  for (const TimedPose& pose : run.truth) {
    double low = 0.0, high = 5.0;  // where the beam passes the wall
    for (int i = 0; i < 60; ++i) {
      const double centre = 0.5 * (low + high);
      const Eigen::Vector3d there = pose.world_from_cam * point_at(beam, centre);
      (there.z() < testing::wall_z(there.x(), there.y()) ? low : high) = centre;
    }
    readings.push_back({pose.t_s, low + 0.003 * draws.normal()});
  }
  return readings;
}

/// By the camera alone: several tests ask for what the unit is then.
const Localization& by_camera(std::uint64_t seed) {
  static std::map<std::uint64_t, Localization> known;
  const auto [at, is_new] = known.try_emplace(seed);
  if (is_new) {
    const WalkRun run = long_walk(swimming(), seed);
    at->second = localize(run.frames, run.camera, LocalizeConfig{}, run.truth);
  }
  return at->second;
}
double true_scale_of(std::uint64_t seed) { return by_camera(seed).error.scale; }

TEST(SensorScale, ADepthSensorGivesMetres) {
  for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(testing::trials(1)); ++seed) {
    const WalkRun run = long_walk(swimming(), seed);
    LocalizeConfig config;
    config.sigma_depth_sensor = 1e-4;  // the readings' own σ is what is asked
    config.depth_readings = depths_of(run, 0.005, seed);
    for (std::size_t i = 0; i < config.depth_readings.size(); i += 37)
      config.depth_readings[i].depth_m += 2.0;  // bubbles
    const Localization result = localize(run.frames, run.camera, config, run.truth);
    EXPECT_TRUE(result.is_scale_read) << result.verdict.sentence;
    ASSERT_EQ(result.sensor_scales.size(), 1u);
    const SensorScale& read = result.sensor_scales.front();
    const double true_scale = true_scale_of(seed);
    EXPECT_NEAR(read.scale / true_scale, 1.0, 3.0 * read.sigma_rel) << seed;
    EXPECT_NEAR(read.scale / true_scale, 1.0, 0.01) << seed;
    EXPECT_LT(read.sigma_rel, 0.005) << seed;
    EXPECT_GE(read.num_rejected, 8u);
    EXPECT_LT(result.error.ate_m, 0.02) << seed;  // in metres, without any scale freedom
    EXPECT_TRUE(result.verdict.ok()) << result.verdict.sentence;
  }
}

TEST(SensorScale, ARangefinderGivesMetres) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    const WalkRun run = long_walk(swimming(), seed);
    LocalizeConfig config;
    config.beam = beam_beside();
    config.range_readings = ranges_of(run, *config.beam, seed);
    const Localization result = localize(run.frames, run.camera, config, run.truth);
    ASSERT_TRUE(result.is_scale_read) << result.verdict.sentence;
    const SensorScale& read = result.sensor_scales.front();
    const double true_scale = true_scale_of(seed);
    EXPECT_NEAR(read.scale / true_scale, 1.0, 3.0 * read.sigma_rel) << seed;
    EXPECT_NEAR(read.scale / true_scale, 1.0, 0.015) << seed;
    EXPECT_LT(result.error.ate_m, 0.03) << seed;
  }
}

/// Without a target nothing shows that depths are 2.6 % too large, as of a sensor for fresh water in the sea.
TEST(SensorScale, ADensityIsCountedAndAUnitNamed) {
  const WalkRun run = long_walk(swimming(), 1);
  LocalizeConfig config;
  config.depth_readings = depths_of(run, 0.005, 1);
  for (DepthReading& reading : config.depth_readings) reading.depth_m *= 1.026;
  const Localization result = localize(run.frames, run.camera, config, run.truth);
  ASSERT_TRUE(result.is_scale_read) << result.verdict.sentence;
  EXPECT_NEAR(std::log(result.sensor_scales.front().scale / true_scale_of(1)), std::log(1.026), 0.01);
  EXPECT_LT(std::log(1.026), 3.0 * result.sensor_scales.front().sigma_rel);
  EXPECT_TRUE(result.verdict.ok()) << result.verdict.sentence;
  for (DepthReading& reading : config.depth_readings) reading.depth_m *= 100.0, reading.sigma_m *= 100.0;
  const Verdict in_cm = localize(run.frames, run.camera, config).verdict;
  EXPECT_NE(in_cm.state, State::good);
  EXPECT_NE(in_cm.sentence.find("in metres? They are not used"), std::string::npos) << in_cm.sentence;
  config.target.points = run.target;  // by which the unit is known
  const Localization with_target = localize(run.frames, run.camera, config, run.truth);
  ASSERT_EQ(with_target.sensor_scales.size(), 1u);
  EXPECT_EQ(with_target.sensor_scales.front().unit, "cm");
  EXPECT_NEAR(with_target.sensor_scales.front().scale, 1.026, 0.02);
  EXPECT_EQ(with_target.verdict.state, State::care) << with_target.verdict.sentence;
}

/// A quarter of a metre before the camera, which is not known: the scale is as sure as that.
TEST(SensorScale, WhereADepthSensorIsIsAssumed) {
  const WalkRun run = long_walk(swimming(), 1);
  LocalizeConfig config;
  config.depth_readings = depths_of(run, 0.005, 1);
  const auto row_of = [&] {
    const std::vector<Assumption> assumed = localize(run.frames, run.camera, config).assumed;
    const auto row = std::ranges::find(assumed, "depth_arm_m", &Assumption::name);
    return row != assumed.end() ? std::optional(*row) : std::nullopt;
  };
  const auto unknown = row_of();
  ASSERT_TRUE(unknown);
  EXPECT_FALSE(unknown->sigma);
  EXPECT_EQ(unknown->ordinary, 0.01);
  EXPECT_GT(unknown->moves, 0.0);
  EXPECT_LT(unknown->moves, 1.0);
  config.sigma_depth_arm_m = 0.01;
  EXPECT_FALSE(row_of());
}

TEST(SensorScale, AClockThatIsOffIsNamedAndCorrected) {
  for (const double late_s : {-0.2, 0.3}) {
    const WalkRun run = long_walk(swimming(), 2);
    LocalizeConfig config;
    config.depth_readings = depths_of(run, 0.005, 2);
    for (DepthReading& reading : config.depth_readings) reading.t_s += late_s;
    const Localization result = localize(run.frames, run.camera, config, run.truth);
    ASSERT_EQ(result.sensor_scales.size(), 1u);
    EXPECT_NEAR(result.sensor_scales.front().late_s, late_s, 0.03);
    EXPECT_NEAR(result.sensor_scales.front().scale / true_scale_of(2), 1.0, 0.01);
    EXPECT_NE(result.verdict.sentence.find("the clock of the depth sensor"), std::string::npos)
        << result.verdict.sentence;
  }
}

/// Beams that are off by as much as their covariance says: 15 mm along themselves are 1 % of the distance.
TEST(SensorScale, WhatIsNotKnownOfTheBeamIsCounted) {
  const WalkRun run = long_walk(swimming(), 1);
  for (const double off_m : {0.0, -0.03, 0.03}) {
    Beam beam = beam_beside();
    const std::vector<RangeReading> readings = ranges_of(run, beam, 1);
    beam.origin_in_cam.z() += off_m;
    beam.cov(2, 2) = 0.015 * 0.015;
    const auto read = scale_by_range(readings, beam, by_camera(1).path, by_camera(1).map);
    ASSERT_TRUE(read);
    EXPECT_NEAR(std::log(read->scale / true_scale_of(1)), 0.0, 3.0 * read->sigma_rel) << off_m;
    // At twice its σ it may as well be another beam.
    EXPECT_LT(read->sigma_rel, off_m == 0.0 ? 0.03 : 0.1);
  }
}

TEST(SensorScale, ASensorThatContradictsTheTargetIsNamed) {
  const WalkRun run = long_walk(swimming(), 5);
  LocalizeConfig config;
  config.target.points = run.target;
  config.depth_readings = depths_of(run, 0.005, 5);
  const Localization agreeing = localize(run.frames, run.camera, config, run.truth);
  EXPECT_FALSE(agreeing.is_scale_read);
  EXPECT_EQ(agreeing.verdict.sentence.find("longer by the depth sensor"), std::string::npos)
      << agreeing.verdict.sentence;
  for (DepthReading& reading : config.depth_readings) reading.depth_m *= 1.1;
  const Verdict verdict = localize(run.frames, run.camera, config, run.truth).verdict;
  EXPECT_EQ(verdict.state, State::bad);
  EXPECT_NE(verdict.sentence.find("longer by the depth sensor"), std::string::npos) << verdict.sentence;
}

TEST(SensorScale, WithoutMovementUpAndDownNoneIsGiven) {
  LongWalk scene = swimming();
  scene.rise_m = 0.0;
  const WalkRun run = long_walk(scene, 2);
  LocalizeConfig config;
  config.depth_readings = depths_of(run, 0.05, 2);
  for (DepthReading& reading : config.depth_readings) reading.depth_m = 7.0;
  const Localization result = localize(run.frames, run.camera, config, run.truth);
  EXPECT_FALSE(result.scale_known);
  EXPECT_NE(result.verdict.state, State::good);
}

/// Of a vehicle that turns and drifts, whose wheels are .4 % larger than it believes, and slip now and then.
std::vector<OdometryReading> odometry_of(const WalkRun& run, std::uint64_t seed) {
  Draws draws(seed);
  std::vector<OdometryReading> readings;
  const Eigen::Quaterniond other = exp_so3(Eigen::Vector3d(0.3, -0.2, 1.1));
  Eigen::Vector3d at(3.0, -2.0, 0.0);
  for (std::size_t i = 0; i < run.truth.size(); ++i) {
    if (i > 0) {
      const Eigen::Vector3d step =
          run.truth[i].world_from_cam.translation - run.truth[i - 1].world_from_cam.translation;
      const double heading = 2e-4 * static_cast<double>(i);
      at += 0.996 * (other * exp_so3(Eigen::Vector3d(0.0, heading, 0.0)) * step) * (1.0 + 0.02 * draws.normal());
      if (i % 151 == 0) at += Eigen::Vector3d(0.05, 0.0, 0.0);  // a wheel spins
    }
    readings.push_back({run.truth[i].t_s, at});
  }
  return readings;
}

TEST(SensorScale, OdometryGivesMetresByItsLengths) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    const WalkRun run = long_walk(swimming(), seed);
    LocalizeConfig config;
    config.odometry_readings = odometry_of(run, seed);
    const Localization result = localize(run.frames, run.camera, config, run.truth);
    ASSERT_TRUE(result.is_scale_read) << result.verdict.sentence;
    const SensorScale& read = result.sensor_scales.front();
    EXPECT_EQ(read.sensor, "odometry");
    const double true_scale = true_scale_of(seed);
    EXPECT_NEAR(read.scale / true_scale, 1.0, 3.0 * read.sigma_rel) << seed;
    EXPECT_NEAR(read.scale / true_scale, 0.996, 0.006) << seed;  // what the wheels are wrong by is not seen
    EXPECT_GE(read.sigma_rel, 0.01) << seed;                     // and is in its σ
    EXPECT_GE(read.num_rejected, 1u) << seed;
  }
}

TEST(SensorScale, OdometryOfACameraThatStandsGivesNone) {
  const WalkRun run = long_walk(swimming(), 4);
  LocalizeConfig config;
  for (const TimedPose& pose : run.truth) config.odometry_readings.push_back({pose.t_s, {1.0, 2.0, 0.0}});
  const Localization result = localize(run.frames, run.camera, config, run.truth);
  EXPECT_FALSE(result.scale_known);
  EXPECT_NE(result.verdict.sentence.find("the readings of the odometry do not determine the scale"), std::string::npos)
      << result.verdict.sentence;
}

}  // namespace
}  // namespace alidade
