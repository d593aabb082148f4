#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include "alidade/calibrate.h"
#include "alidade/files/files.h"
#include "alidade/observe.h"
#include "alidade/rangefinder.h"
#include "alidade/results/observation_result.h"
#include "alidade/results/observe_outcome.h"
#include "alidade/results/photos_outcome.h"
#include "alidade/results/rangefinder_outcome.h"
#include "alidade/results/rangefinder_result.h"
#include "alidade/results/result_board.h"
#include "alidade/results/shots_outcome.h"
#include "alidade/simulate/rangefinder.h"
#include "alidade/simulate/rotation.h"
#include "alidade/testing/calibration_sample.h"
#include "alidade/testing/temporary_folder.h"

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

/// A head without a word about how exact it is.
RotationLog head_log() {
  RotationScene scene;
  scene.start_px = draw_points(780, 582, 8, 1);
  scene.motion = [](double t_s) { return paper_pan_tilt(t_s, 0.0); };
  RotationLog log = simulate_rotation(scene, {.source = RotationSource::head, .rate_hz = 10.0}, 1);
  log.truth.clear();
  log.sigma_scale.reset();
  return log;
}

TEST(Plans, AnObservationIsReadAsItWasWritten) {
  ObserveConfig config{.estimate = {"mount"}, .width_px = 780, .height_px = 582};
  config.rotation = RotationKnowledge::noisy;
  config.sigma_angle_rad = 3e-4;
  const ObserveReport report = observe(head_log(), config);
  ASSERT_TRUE(report.verdict.ok()) << report.verdict.sentence;
  const testing::TemporaryFolder folder;
  const auto file = folder.path() / "result.json";
  const auto read_back = [&](const ObserveReport& written) {
    write_file(file, result_text(outcome_of(written).document));
    return read_observation(file);
  };
  const ObservedNow now = observed_now(report), read = read_back(report);
  EXPECT_EQ(read.source, RotationSource::head);
  EXPECT_NEAR(read.frames_per_s, 10.0, 0.01);
  EXPECT_EQ(read.sigma_angle_rad, 3e-4);
  EXPECT_EQ(read.points_px.size(), now.points_px.size());
  ASSERT_EQ(plan_moves(read).moves.size(), plan_moves(now).moves.size());
  for (std::size_t i = 0; i < 3; ++i) {
    const NextMove a = plan_moves(now).moves[i], b = plan_moves(read).moves[i];
    EXPECT_EQ(a.pan_tilt_roll_rad, b.pan_tilt_roll_rad);
    EXPECT_LT((a.sigma_px - b.sigma_px).norm(), 0.01 * a.sigma_px.norm());  // pixels are written with two decimals
  }
  config.rotation = RotationKnowledge::free;
  config.sigma_angle_rad.reset();
  config.estimate.clear();
  const ObserveReport free = observe(head_log(), config);
  ASSERT_FALSE(free.quantities.empty()) << free.verdict.sentence;
  EXPECT_THROW((void)read_back(free), InputError);
  EXPECT_THROW((void)observed_now(free), ConfigError);
}

/// Shots of a simulated rangefinder; those in excess of `num_spots` have none.
std::vector<Shot> shots_of(int num_spots) {
  RangefinderSceneConfig scene = *rangefinder_scenario("reference");
  scene.num_shots = 12;
  std::vector<Shot> shots = simulate_shots(draw_rangefinder_scene(scene, 2), {}, 2).shots;
  for (std::size_t i = 0; i < shots.size(); ++i) {
    shots[i].name = "shot " + std::to_string(i);
    if (static_cast<int>(i) >= num_spots) shots[i].spot.reset();
  }
  return shots;
}

TEST(Plans, ARangefinderIsReadAsItWasWritten) {
  const RangefinderSceneConfig scene = *rangefinder_scenario("reference");
  for (const int num_spots : {12, 0}) {
    for (const Refine refine : {Refine::all, Refine::beam}) {
      const RangefinderConfig config{.refine = refine, .board = scene.board, .sigma_range_m = 0.002};
      const RangefinderCalibration report = rangefinder(shots_of(num_spots), scene.camera, config);
      ASSERT_TRUE(report.verdict.ok()) << report.verdict.sentence;
      const testing::TemporaryFolder folder;
      const JobOutcome outcome = outcome_of(report, "");
      write_file(folder.path() / "result.json", result_text(outcome.document));
      for (const auto& file : outcome.files) write_file(folder.path() / file.name, file.bytes);
      const BeamNow read = read_rangefinder(folder.path()), now = beam_now(report, report.config);
      EXPECT_EQ(read.refine, refine);
      EXPECT_EQ(read.sees_spots, num_spots > 0);
      EXPECT_TRUE(read.sees_boards);
      ASSERT_EQ(read.taken.size(), now.taken.size());
      EXPECT_DOUBLE_EQ(read.sheet.left_m, now.sheet.left_m);
      EXPECT_LT((read.sheet.moves - now.sheet.moves).norm(), 1e-12);
      const ShotPlan a = plan_shots(now), b = plan_shots(read);
      ASSERT_EQ(a.shots.size(), b.shots.size());
      EXPECT_NEAR(a.shots.back().sigma_origin_m / b.shots.back().sigma_origin_m, 1.0, 0.01);
      EXPECT_NEAR(a.shots.back().sigma_direction_rad / b.shots.back().sigma_direction_rad, 1.0, 0.01);
      EXPECT_EQ(outcome_of(a).document.assumed.size(), num_spots > 0 ? 0u : 1u);
    }
  }
}

TEST(Plans, FewerShotsThanAskedForAreSaid) {
  const RangefinderSceneConfig scene = *rangefinder_scenario("reference");
  const RangefinderConfig config{.board = scene.board, .sigma_range_m = 0.002};
  const RangefinderCalibration report = rangefinder(shots_of(12), scene.camera, config);
  const BeamNow now = beam_now(report, report.config);
  const ShotPlan few = plan_shots(now, {.shots = 10, .min_range_m = 0.6, .max_range_m = 0.65, .max_tilt_deg = 0.0});
  EXPECT_LT(few.shots.size(), 10u);
  EXPECT_NE(few.verdict.to_add.find("instead of 10"), std::string::npos) << few.verdict.to_add;
  EXPECT_EQ(plan_shots(now, {.shots = 3}).verdict.to_add, "");
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
