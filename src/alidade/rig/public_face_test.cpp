#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/core.hpp>

#include "alidade/results/rig_outcome.h"
#include "alidade/rig.h"
#include "alidade/rig/rig.h"
#include "alidade/simulate/rig.h"
#include "alidade/testing/rig_sample.h"

// The whole job through its public header: the same rig as from the parts, and an answer to every misuse.

namespace alidade {
namespace {

struct FaceScene {
  RigScene scene = draw_rig_scene({}, 1);
  std::vector<HeadView> views = simulate_head_views(scene, {}, 1).views;
  std::map<int, Camera> cameras = testing::cameras_of(scene.rig);
};

RigConfig face_config(const FaceScene& face) {
  RigConfig config;
  config.board = face.scene.board;
  return config;
}

std::string face_fault(const FaceScene& face, const RigConfig& config) {
  try {
    (void)rig(face.views, face.cameras, config);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

TEST(RigFace, IsTheWholeJob) {
  const FaceScene face;
  const RigConfig config = face_config(face);
  const RigCalibration result = rig(face.views, face.cameras, config);
  ASSERT_TRUE(result.verdict.ok()) << result.verdict.sentence;
  const RigReport parts = calibrate_rig_by_need(face.views, points_in_board(face.scene.board), face.cameras, config);
  EXPECT_EQ(result.rig.cov, parts.rig.cov);
  EXPECT_EQ(result.covariance, result.rig.cov);
  EXPECT_EQ(result.parameter_names.size(), static_cast<std::size_t>(result.covariance.rows()));
  EXPECT_EQ(result.parameter_names.front(), "head1.base_x_m");
  EXPECT_EQ(result.counts.given, face.views.size());
  EXPECT_EQ(result.counts.used + result.counts.dropped, face.views.size());
  const JobOutcome outcome = outcome_of(result);
  EXPECT_EQ(outcome.document.command, "rig");
  EXPECT_EQ(outcome.files.back().name, "rig.yaml");
}

/// Readings from 0 to a turn: a scale that is not exactly one, or its σ, counted for the whole turn between neighbours.
TEST(RigFace, ReadingsThatBeginAgainAfterATurnAreThoseOfOneArc) {
  const FaceScene face;
  FaceScene wrapped;
  for (HeadView& view : wrapped.views)
    for (double& reading : view.pan_tilt_rad)
      if (reading < 0.0) reading += 2.0 * std::numbers::pi;
  RigConfig config = face_config(face);
  config.sigma_scale = 1e-3;
  const RigCalibration result = rig(wrapped.views, face.cameras, config);
  const RigCalibration expected = rig(face.views, face.cameras, config);
  ASSERT_TRUE(expected.verdict.ok());
  EXPECT_EQ(result.verdict.sentence, expected.verdict.sentence);
  EXPECT_TRUE(result.covariance.diagonal().isApprox(expected.covariance.diagonal(), 1e-3));
}

TEST(RigFace, AnswersEveryHostileNumber) {
  const FaceScene face;
  const double inf = std::numeric_limits<double>::infinity();
  for (const double bad : {std::nan(""), inf, -inf, -1.0, 0.0}) {
    RigConfig config = face_config(face);
    config.sigma_px = bad;
    EXPECT_THAT(face_fault(face, config), ::testing::HasSubstr("sigma_px")) << bad;
    config = face_config(face);
    config.sigma_encoder_rad = bad;
    EXPECT_THAT(face_fault(face, config), ::testing::HasSubstr("sigma_angle_rad")) << bad;
    config = face_config(face);
    config.sigma_square_m = bad;
    EXPECT_THAT(face_fault(face, config), ::testing::HasSubstr("sigma_square_m")) << bad;
    config = face_config(face);
    config.sigma_scale = bad;
    EXPECT_THAT(face_fault(face, config), ::testing::HasSubstr("sigma_scale")) << bad;
    config = face_config(face);
    config.board->square_m = bad;
    EXPECT_NE(face_fault(face, config), "") << bad;
  }
}

TEST(RigFace, AnswersWhatDoesNotGoTogether) {
  FaceScene face;
  EXPECT_THAT(face_fault(face, {}), ::testing::HasSubstr("--board"));
  RigConfig config = face_config(face);
  config.estimate_scales = true;
  config.sigma_scale = 0.001;
  EXPECT_THAT(face_fault(face, config), ::testing::HasSubstr("--sigma-scale"));
  config = face_config(face);
  face.views[2].pan_tilt_rad.x() = std::nan("");
  EXPECT_THAT(face_fault(face, config), ::testing::HasSubstr("not finite"));
  face = {};
  face.views[2].seen.corners[0].px.x() = 5000.0;
  EXPECT_THAT(face_fault(face, config), ::testing::HasSubstr("another camera"));
  face = {};
  face.cameras.begin()->second.width_px = 0;
  EXPECT_THAT(face_fault(face, config), ::testing::HasSubstr("image size"));
  EXPECT_THROW((void)cameras_by_head({1, 2}, std::vector<Camera>(3)), ConfigError);
}

TEST(RigFace, NamesViewsThatCannotBe) {
  FaceScene face;
  face.views[2].seen.corners[0].index = 5000;
  face.views[3].head = 77;
  face.views[4].seen.corners.push_back(face.views[4].seen.corners[0]);
  const RigCalibration result = rig(face.views, face.cameras, face_config(face));
  EXPECT_TRUE(result.verdict.ok()) << result.verdict.sentence;
  EXPECT_THAT(result.views[4].reason, ::testing::HasSubstr("appears twice"));
  for (const std::size_t v : {2U, 3U, 4U}) {
    EXPECT_FALSE(result.views[v].used);
    EXPECT_NE(result.views[v].reason, "");
  }
  EXPECT_EQ(rig({}, face.cameras, face_config(face)).verdict.exit_code, ExitCode::undetermined);
  EXPECT_EQ(rig(face.views, {}, face_config(face)).verdict.exit_code, ExitCode::undetermined);
}

TEST(RigFace, NamesPhotosThatCannotBeUsed) {
  const FaceScene face;
  const PhotoByName load = [](const std::string& name) -> cv::Mat {
    if (name == "view 0") throw std::runtime_error("cannot be read");
    return cv::Mat::zeros(240, 320, CV_8U);
  };
  const RigCalibration result = rig(face.views, face.cameras, face_config(face), load);
  EXPECT_EQ(result.verdict.exit_code, ExitCode::undetermined);
  EXPECT_EQ(result.no_board.size(), face.views.size());
  EXPECT_EQ(result.counts.given, face.views.size());
  EXPECT_LE(result.unreadable.size(), result.no_board.size());
}

/// The words of the command line are the members of the config.
TEST(RigConfig, ReadsWhatIsToBeEstimated) {
  RigConfig config;
  const FieldList fields = fields_of(config);
  const auto estimate = std::ranges::find_if(fields, [](const Field& field) { return field.name == "estimate"; });
  ASSERT_NE(estimate, fields.end());
  EXPECT_EQ(value_text(*estimate), "auto");
  EXPECT_EQ(set_field(*estimate, "scale,focal"), "");
  EXPECT_TRUE(config.estimate_scales && config.estimate_focal && !config.estimate_by_need && !config.estimate_once);
  EXPECT_EQ(value_text(*estimate), "scale,focal");
  EXPECT_EQ(set_field(*estimate, "none"), "");
  EXPECT_EQ(value_text(*estimate), "none");
  EXPECT_EQ(set_field(*estimate, "auto,scale"), "'auto' excludes the others");
  EXPECT_NE(set_field(*estimate, "scale,"), "");
  EXPECT_NE(set_field(*estimate, "x"), "");
}

}  // namespace
}  // namespace alidade
