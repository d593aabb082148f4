#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "alidade/network.h"
#include "alidade/network/moving_target.h"
#include "alidade/results/network_outcome.h"

// The whole job through its public header: the same cameras as from the parts, and an answer to every misuse.

namespace alidade {
namespace {

struct FaceLog {
  std::vector<RigHead> heads;
  std::vector<TargetObservation> observations;
  MovingTargetConfig config = {.distance = KnownDistance{1, 2, 6.0, 0.01}};
};

/// Two cameras 6 m apart look at a target that loops 20 m before them; exact pixels.
FaceLog face_log() {
  FaceLog log;
  for (int id : {1, 2}) {
    RigHead& head = log.heads.emplace_back();
    head.head.id = id;
    head.camera.width_px = 1920;
    head.camera.height_px = 1080;
    Calibrated<Pinhole> lens;
    lens.params.head<4>() = Eigen::Vector4d(900.0, 900.0, 960.0, 540.0);
    head.camera.lens = lens;
    head.camera.cov.setZero(5, 5);  // exact
  }
  for (int k = 0; k < 600; ++k) {
    const double t_s = k / 25.0;
    const Eigen::Vector3d point(3.0 + 6.0 * std::sin(0.5 * t_s), 3.0 * std::sin(0.8 * t_s + 1.0),
                                20.0 + 6.0 * std::cos(0.4 * t_s));
    for (std::size_t h = 0; h < 2; ++h) {
      const Eigen::Vector3d seen = point - Eigen::Vector3d(6.0 * static_cast<double>(h), 0.0, 0.0);
      TargetObservation& observation = log.observations.emplace_back();
      observation.t_capture_s = observation.t_arrival_s = t_s;
      observation.head = h;
      const double wobble = 0.3 * std::sin(17.0 * k + static_cast<double>(h));  // nothing is exact
      observation.px = {960.0 + 900.0 * seen.x() / seen.z() + wobble, 540.0 + 900.0 * seen.y() / seen.z() - wobble};
    }
  }
  return log;
}

std::string face_fault(const FaceLog& log, const TrueTrack& truth = {}) {
  try {
    (void)network(log.observations, log.heads, log.config, truth);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

TEST(NetworkFace, IsTheWholeJob) {
  const FaceLog log = face_log();
  const NetworkCalibration result = network(log.observations, log.heads, log.config);
  ASSERT_TRUE(result.verdict.ok()) << result.verdict.sentence;
  const MovingTargetReport parts = place_cameras(log.observations, log.heads, log.config);
  EXPECT_EQ(result.rig.cov, parts.rig.cov);
  EXPECT_NEAR(result.rig.heads[1].head.world_from_base.translation.norm(), 6.0, 0.05);
  EXPECT_EQ(result.parameter_names.size(), static_cast<std::size_t>(result.covariance.rows()));
  EXPECT_EQ(result.counts.given, log.observations.size());
  EXPECT_EQ(result.counts.used + result.counts.dropped, log.observations.size());
  const JobOutcome outcome = outcome_of(result);
  EXPECT_EQ(outcome.document.command, "rig");
  EXPECT_EQ(outcome.files.back().name, "path.csv");
}

TEST(NetworkFace, AnswersEveryHostileNumber) {
  const double inf = std::numeric_limits<double>::infinity();
  for (const double bad : {std::nan(""), inf, -inf, -1.0, 1e300}) {
    FaceLog log = face_log();
    log.config.clock_search_s = bad;
    EXPECT_THAT(face_fault(log), ::testing::HasSubstr("clocks_s")) << bad;
    log = face_log();
    log.config.sigma_px = -std::abs(bad);
    EXPECT_THAT(face_fault(log), ::testing::HasSubstr("sigma_px")) << bad;
    log = face_log();
    log.config.distance->distance_m = -std::abs(bad);
    EXPECT_THAT(face_fault(log), ::testing::HasSubstr("--distance")) << bad;
    log = face_log();
    log.config.distance->sigma_m = -std::abs(bad);
    EXPECT_THAT(face_fault(log), ::testing::HasSubstr("--distance")) << bad;
  }
}

TEST(NetworkFace, AnswersWhatDoesNotGoTogether) {
  FaceLog log = face_log();
  log.config.distance->second = 9;
  EXPECT_THAT(face_fault(log), ::testing::HasSubstr("9 is not a head"));
  EXPECT_THAT(face_fault(face_log(), {.t_s = {0.0}, .position = {Eigen::Vector3d::Zero()}}),
              ::testing::HasSubstr("--truth gives the scale"));
  log = face_log();
  log.observations[3].head = 5;
  EXPECT_THAT(face_fault(log), ::testing::HasSubstr("observation 3"));
  log = face_log();
  log.observations[4].px.x() = std::nan("");
  EXPECT_THAT(face_fault(log), ::testing::HasSubstr("observation 4"));
  log = face_log();
  log.config.distance.reset();
  EXPECT_THAT(face_fault(log, {.t_s = {0.0, 1.0}, .position = {Eigen::Vector3d::Zero()}}),
              ::testing::HasSubstr("true path"));
  log = face_log();
  log.heads[0].camera.width_px = 0;
  EXPECT_THAT(face_fault(log), ::testing::HasSubstr("image size"));
}

TEST(NetworkFace, AnswersEmptyInput) {
  const FaceLog log = face_log();
  EXPECT_EQ(network({}, log.heads, log.config).verdict.exit_code, ExitCode::undetermined);
  EXPECT_EQ(network({}, {}, {}).verdict.exit_code, ExitCode::undetermined);
}

}  // namespace
}  // namespace alidade
