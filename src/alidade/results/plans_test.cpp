#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include "alidade/calibrate.h"
#include "alidade/files/files.h"
#include "alidade/results/photos_outcome.h"
#include "alidade/results/result_board.h"
#include "alidade/results/shots_outcome.h"
#include "alidade/testing/calibration_sample.h"

// What to measure next, from values; and an answer to every misuse.

namespace alidade {
namespace {

CalibratedNow calibrated() {
  const auto scene = testing::sample_scene(testing::sample_camera("brown"), 8, 1);
  return calibrated_now(calibrate(testing::sample_views(scene, 1), testing::sample_size, testing::sample_board));
}

TEST(Plans, PhotosAfterACalibration) {
  const CalibratedNow now = calibrated();
  const PhotoPlan plan = plan_photos(now, {.photos = 2});
  ASSERT_TRUE(plan.verdict.ok()) << plan.verdict.sentence;
  EXPECT_EQ(plan.photos.size(), 2u);
  EXPECT_LT(plan.photos.back().worst_3sigma_px, plan.worst_3sigma_px);
  const JobOutcome outcome = outcome_of(plan);
  EXPECT_EQ(outcome.lines.size(), 2u);
  EXPECT_EQ(outcome.document.data.size(), 2u);
  CalibratedNow unknown = now;
  unknown.camera.cov.resize(0, 0);
  EXPECT_EQ(plan_photos(unknown).verdict.exit_code, ExitCode::undetermined);
  EXPECT_THROW((void)calibrated_now(Calibration{}), ConfigError);
}

TEST(Plans, AnswerWhatCannotBe) {
  const CalibratedNow now = calibrated();
  for (const int bad : {0, -1, 21}) {
    EXPECT_THROW((void)plan_photos(now, {.photos = bad}), ConfigError);
    EXPECT_THROW((void)plan_shots({}, {.shots = bad}), ConfigError);
  }
  EXPECT_THROW((void)plan_photos({}), ConfigError);
  EXPECT_THROW((void)plan_shots({}), ConfigError);
  const double inf = std::numeric_limits<double>::infinity();
  for (const double bad : {std::nan(""), inf, -inf, -1.0}) {
    CalibratedNow wrong = now;
    wrong.noise_px = bad;
    EXPECT_THROW((void)plan_photos(wrong), ConfigError) << bad;
    BeamNow beam;
    beam.camera = now.camera;
    beam.beam.direction_in_cam = Eigen::Vector3d::UnitZ();
    EXPECT_THROW((void)plan_shots(beam, {.min_range_m = bad}), ConfigError) << bad;
    EXPECT_THROW((void)plan_shots(beam, {.max_tilt_deg = bad}), ConfigError) << bad;
    beam.sigma_spot_px = bad;
    EXPECT_THROW((void)plan_shots(beam), ConfigError) << bad;
  }
}

/// `plan rangefinder` reserved room for as many corners as the file said.
TEST(Plans, ABoardOfAResultThatIsNoneIsRefused) {
  const nlohmann::json right{{"kind", "chessboard"}, {"cols", 9}, {"rows", 6}, {"square_m", 0.04}, {"marker_m", 0.0}};
  EXPECT_EQ(result_board(right.dump()).cols, 9);
  for (const char* key : {"cols", "rows", "square_m"})
    for (const double bad : {-1.0, 0.0, key == std::string("square_m") ? -1e300 : 1e300}) {
      nlohmann::json wrong = right;
      wrong[key] = bad;
      EXPECT_THROW((void)result_board(wrong.dump()), InputError) << key << ' ' << bad;
    }
  nlohmann::json wrong = right;
  wrong["kind"] = "none";
  EXPECT_THROW((void)result_board(wrong.dump()), InputError);
}

}  // namespace
}  // namespace alidade
