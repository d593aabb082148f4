#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/core.hpp>

#include "alidade/rangefinder.h"
#include "alidade/rangefinder/rangefinder.h"
#include "alidade/results/rangefinder_outcome.h"
#include "alidade/testing/rangefinder_sample.h"

// The whole job through its public header: the same beam as from the parts, and an answer to every misuse.

namespace alidade {
namespace {

const testing::RangefinderSample& face_sample() {
  static const auto drawn = testing::draw_rangefinder_sample(*rangefinder_scenario("reference"), {}, 1);
  return drawn;
}

RangefinderConfig face_config() {
  RangefinderConfig config;
  config.board = face_sample().scene.board;
  return config;
}

std::string face_fault(const RangefinderConfig& config) {
  try {
    (void)rangefinder(face_sample().simulated.shots, face_sample().camera, config);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

TEST(RangefinderFace, IsTheWholeJob) {
  const testing::RangefinderSample& sample = face_sample();
  const RangefinderCalibration result = rangefinder(sample.simulated.shots, sample.camera, face_config());
  ASSERT_TRUE(result.verdict.ok()) << result.verdict.sentence;
  const SolvedRangefinder parts =
      solve_rangefinder(sample.simulated.shots, sample.points, sample.camera, face_config());
  EXPECT_EQ(result.beam.origin_in_cam, parts.report.beam.origin_in_cam);
  EXPECT_EQ(result.beam.cov, parts.report.beam.cov);
  EXPECT_EQ(result.counts.given, sample.simulated.shots.size());
  EXPECT_EQ(result.counts.used, static_cast<std::size_t>(result.shots_used));
  EXPECT_EQ(result.covariance.rows(), 7);
  EXPECT_EQ(result.parameter_names.size(), 7u);
  EXPECT_FALSE(result.assumed.empty());
  const JobOutcome outcome = outcome_of(result);
  EXPECT_EQ(outcome.document.command, "rangefinder");
  ASSERT_EQ(outcome.files.size(), 2u);
  EXPECT_EQ(outcome.files[0].name, "rangefinder.yaml");
}

TEST(RangefinderFace, AnswersEveryHostileNumber) {
  const double inf = std::numeric_limits<double>::infinity();
  for (const double bad : {std::nan(""), inf, -inf, -1.0, 0.0}) {
    RangefinderConfig config = face_config();
    config.sigma_spot_px = bad;
    EXPECT_THAT(face_fault(config), ::testing::HasSubstr("sigma_px")) << bad;
    config = face_config();
    config.sigma_range_m = bad;
    EXPECT_THAT(face_fault(config), ::testing::HasSubstr("sigma_range_m")) << bad;
    config = face_config();
    config.sigma_range_m = 0.002;
    config.sigma_range_per_m = bad;
    EXPECT_THAT(face_fault(config), ::testing::HasSubstr("sigma_range_per_m")) << bad;
    config = face_config();
    config.sigma_corner_px = bad;
    EXPECT_NE(face_fault(config), "") << bad;
    config = face_config();
    config.outlier_sigmas = -std::abs(bad);
    EXPECT_NE(face_fault(config), "") << bad;
    config = face_config();
    config.board->square_m = bad;
    EXPECT_NE(face_fault(config), "") << bad;
    if (bad == 0.0) continue;  // exact
    config = face_config();
    config.sigma_square_m = bad;
    EXPECT_THAT(face_fault(config), ::testing::HasSubstr("sigma_square_m")) << bad;
    config = face_config();
    config.sigma_scale = bad;
    EXPECT_THAT(face_fault(config), ::testing::HasSubstr("sigma_scale")) << bad;
  }
}

TEST(RangefinderFace, AnswersWhatDoesNotGoTogether) {
  RangefinderConfig config = face_config();
  config.estimate_scale = true;
  config.sigma_scale = 0.001;
  EXPECT_THAT(face_fault(config), ::testing::HasSubstr("--sigma-scale"));
  config = face_config();
  config.sigma_range_per_m = 0.001;
  EXPECT_THAT(face_fault(config), ::testing::HasSubstr("--sigma-range-m"));
  config = {};
  config.sigma_square_m = 0.001;
  EXPECT_THAT(face_fault(config), ::testing::HasSubstr("--board"));
  EXPECT_THAT(face_fault({}), ::testing::HasSubstr("no board is given"));
  config = face_config();
  config.num_draws = -3;
  EXPECT_NE(face_fault(config), "");
}

/// What the shots show is never thrown: a shot that cannot be is named, the others count.
TEST(RangefinderFace, NamesShotsThatCannotBe) {
  const double nan = std::nan("");
  for (int kind = 0; kind < 6; ++kind) {
    std::vector<Shot> shots = face_sample().simulated.shots;
    Shot& shot = shots[3];
    if (kind == 0) shot.range_m = nan;
    if (kind == 1) shot.spot = Spot{.px = {nan, 3.0}};
    if (kind == 2) shot.sigma_range_m = -1.0;
    if (kind == 3) shot.plane = Plane{.normal_in_cam = Eigen::Vector3d::Zero(), .d_m = nan};
    if (kind == 4) shot.board->corners[0].index = 5000;
    if (kind == 5) shot.board->corners[0].index = shot.board->corners[1].index;
    const RangefinderCalibration result = rangefinder(shots, face_sample().camera, face_config());
    EXPECT_TRUE(result.verdict.ok()) << kind << result.verdict.sentence;
    EXPECT_FALSE(result.shots[3].used) << kind;
    EXPECT_NE(result.shots[3].reason, "") << kind;
  }
}

TEST(RangefinderFace, AnswersEmptyInputAndHostileCameras) {
  const Camera& camera = face_sample().camera;
  EXPECT_EQ(rangefinder({}, camera).verdict.exit_code, ExitCode::undetermined);
  EXPECT_THROW((void)rangefinder({}, Camera{}), ConfigError);
  Camera no_focal = camera;
  Eigen::VectorXd lens = params(camera.lens);
  lens[0] = std::nan("");
  no_focal.lens = with_params(camera.lens, lens);
  EXPECT_THROW((void)rangefinder({}, no_focal), ConfigError);
}

/// A photo that cannot be used takes its shot with it, by name, and stops nothing.
TEST(RangefinderFace, NamesPhotosThatCannotBeUsed) {
  std::vector<Shot> shots = face_sample().simulated.shots;
  shots[2].photo = "small.png";
  shots[5].photo = "gone.png";
  shots[5].table = "shots.csv";
  shots[5].line = 7;
  const PhotoByName load = [](const std::string& name) -> cv::Mat {
    if (name == "gone.png") throw std::runtime_error("cannot be read");
    return cv::Mat::zeros(4, 4, CV_8U);
  };
  const RangefinderCalibration result = rangefinder(shots, face_sample().camera, face_config(), load);
  ASSERT_EQ(result.unreadable.size(), 2u);
  EXPECT_EQ(result.counts.given, shots.size());
  EXPECT_EQ(result.measured.size(), shots.size() - 2);
  EXPECT_EQ(result.counts.skipped[1].line, 7u);
  EXPECT_EQ(result.counts.skipped[1].reason, "cannot be read");
  EXPECT_TRUE(result.verdict.ok()) << result.verdict.sentence;
}

TEST(RangefinderFace, EdgesAnswerMisuse) {
  const Camera& camera = face_sample().camera;
  GreyImage grey{camera.width_px, camera.height_px, {}};
  EXPECT_THROW((void)rangefinder_by_edges({}, grey, camera), ConfigError);
  grey.values.resize(static_cast<std::size_t>(camera.width_px) * static_cast<std::size_t>(camera.height_px));
  EXPECT_EQ(rangefinder_by_edges({}, grey, camera).verdict.exit_code, ExitCode::undetermined);
  for (const double bad : {std::nan(""), -1.0, 0.0}) {
    EXPECT_THROW((void)rangefinder_by_edges({}, grey, camera, {.jump_m = bad}), ConfigError) << bad;
    EXPECT_THROW((void)rangefinder_by_edges({}, grey, camera, {.blur_px = {bad}}), ConfigError) << bad;
  }
  EXPECT_THROW((void)rangefinder_by_edges({}, grey, camera, {.blur_px = {}}), ConfigError);
}

}  // namespace
}  // namespace alidade
