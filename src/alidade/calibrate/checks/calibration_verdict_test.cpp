#include "alidade/calibrate/checks/calibration_verdict.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "alidade/testing/calibration_sample.h"
#include "alidade/testing/trials.h"

namespace alidade {
namespace {

using testing::check_named;
using testing::covered_scene;
using ::testing::HasSubstr;
using testing::sample_calibration;
using testing::sample_camera;
using testing::sample_scene;
using testing::sample_views;

std::vector<BoardView> clean_views(std::uint64_t seed, bool know_sigma = true) {
  return sample_views(covered_scene(sample_camera("brown"), 20, seed), seed, know_sigma);
}

/// The number after `words` in a text.
double number_after(const std::string& text, const std::string& words) {
  const auto at = text.find(words);
  if (at == std::string::npos) throw std::logic_error("'" + words + "' is not in '" + text + "'");
  return std::stod(text.substr(at + words.size()));
}

/// Two significant digits: what a text may differ by from the number that it represents.
double half_a_digit(double value) { return 0.5 * std::pow(10.0, std::floor(std::log10(value)) - 1.0) * 1.0001; }

TEST(CalibrationVerdict, CleanDataIsGood) {
  for (const bool know_sigma : {true, false}) {
    const Calibration result = sample_calibration(clean_views(1, know_sigma));
    EXPECT_EQ(result.verdict.state, State::good) << result.verdict.sentence;
    EXPECT_EQ(result.verdict.exit_code, ExitCode::ok);
    EXPECT_TRUE(result.verdict.to_add.empty()) << result.verdict.to_add;
    EXPECT_THAT(result.verdict.sentence, ::testing::StartsWith("Good: "));
    EXPECT_EQ(result.verdict.checks.size(), 10u);
    for (const Check& check : result.verdict.checks) EXPECT_EQ(check.state, State::good) << check.text;
  }
}

/// As `alidade simulate board` takes its photos; ALIDADE_TEST_TRIALS=40 draws as many sets.
TEST(CalibrationVerdict, PhotosIntoTheCornersAreGoodNineteenTimesInTwenty) {
  const int sets = testing::trials(8);
  int good = 0;
  std::string others;
  for (int set = 1; set <= sets; ++set) {
    const BoardSceneConfig photos{.num_photos = 20, .into_corners = true};
    const auto seed = static_cast<std::uint64_t>(set);
    const BoardScene scene = draw_board_scene(sample_camera("brown"), testing::sample_board, photos, seed);
    const Verdict verdict = sample_calibration(sample_views(scene, seed)).verdict;
    good += verdict.state == State::good;
    if (verdict.state != State::good) others += std::to_string(set) + ": " + verdict.sentence + '\n';
  }
  const double misses = 0.05 * sets;  // expected at most, and three standard deviations of that number
  EXPECT_LE(sets - good, misses + 3.0 * std::sqrt(0.95 * misses)) << others;
}

TEST(CalibrationVerdict, ItsNumbersAreThoseOfTheStudy) {
  // Eight photos: some of the image is not good.
  const auto views = sample_views(sample_scene(sample_camera("brown"), 8, 5), 5);
  const Calibration result = sample_calibration(views);
  double worst = 0.0, below_half = 0.0, below_one = 0.0;
  const auto& sigmas = result.study.sigma_infinity.values;
  for (const double sigma : sigmas) {
    if (!std::isfinite(sigma)) continue;
    worst = std::max(worst, 3 * sigma);
    below_half += 3 * sigma <= 0.5;
    below_one += 3 * sigma <= 1.0;
  }
  below_half *= 100.0 / static_cast<double>(sigmas.size());
  below_one *= 100.0 / static_cast<double>(sigmas.size());
  const Verdict& verdict = result.verdict;
  EXPECT_NEAR(number_after(verdict.sentence, "3σ is below 0.5 px in "), below_half, half_a_digit(below_half));
  const Check& coverage = check_named(verdict, "coverage");
  EXPECT_NEAR(number_after(coverage.text, "3σ is below 1 px in "), below_one, half_a_digit(below_one));
  EXPECT_NEAR(number_after(coverage.text, "worst "), worst, half_a_digit(worst));
  EXPECT_NEAR(coverage.value, below_one, 1e-9);
  const Check& consistent = check_named(verdict, "consistent");
  EXPECT_NEAR(consistent.value, result.study.halves->worst_z, 1e-12);
  EXPECT_THAT(consistent.text, HasSubstr(" in " + result.study.halves->worst_name));
  EXPECT_NEAR(check_named(verdict, "board flat").value,
              result.study.transfer->transfer_rms_px / result.study.transfer->flat_rms_px, 1e-12);
}

TEST(CalibrationVerdict, AdviceIsThePlannedPhoto) {
  // All boards in one corner of the image: the rest is a guess.
  BoardScene scene = sample_scene(sample_camera("brown"), 40, 3);
  std::erase_if(scene.cam_from_board, [&](const Rigid3& pose) {
    const auto px = project(scene.camera, pose * Eigen::Vector3d(0.1, 0.06, 0.0));
    return !px || px->x() > 330 || px->y() > 300;
  });
  ASSERT_GE(scene.cam_from_board.size(), 6u);
  const Calibration result = sample_calibration(sample_views(scene, 3));
  ASSERT_EQ(check_named(result.verdict, "coverage").state, State::care) << result.verdict.sentence;
  ASSERT_FALSE(result.next.photos.empty());
  const double promised = result.next.photos.front().worst_3sigma_px;
  EXPECT_NEAR(number_after(result.verdict.to_add, " to "), promised, half_a_digit(promised));
}

TEST(CalibrationVerdict, WrongCornersOfATutorialAreNamed) {
  auto views = clean_views(2, false);
  views[7].corners[30].px += Eigen::Vector2d(4.0, 3.0);
  views[2].corners[11].px += Eigen::Vector2d(-3.0, 1.0);
  views[12].corners[5].px += Eigen::Vector2d(0.0, 3.5);
  CalibrateConfig config;
  config.outliers = OutlierRule::keep;  // corners without σ are judged as they are
  const Calibration result = sample_calibration(views, config);
  const Check& corners = check_named(result.verdict, "honest corners");
  EXPECT_NE(corners.state, State::good) << corners.text;
  EXPECT_THAT(corners.text, HasSubstr("(" + views[7].photo + ", corner 30)"));
  EXPECT_THAT(corners.text, HasSubstr("3 corners are more than 6σ off"));
  EXPECT_NE(result.verdict.state, State::good);
  EXPECT_THAT(result.verdict.sentence, HasSubstr(views[7].photo));
}

TEST(CalibrationVerdict, ACornerIsHeldToItsOwnSigma) {
  auto views = clean_views(2);
  Corner& corner = views[7].corners[30];
  corner.px.x() += 8.0 * std::sqrt(corner.cov(0, 0));  // of the others
  const Check far = check_named(sample_calibration(views).verdict, "honest corners");
  EXPECT_EQ(far.state, State::care) << far.text;
  EXPECT_THAT(far.text, HasSubstr("1 corner is more than 6σ off"));
  corner.cov *= 64.0;  // blurred, and says so
  const Check blurred = check_named(sample_calibration(views).verdict, "honest corners");
  EXPECT_EQ(blurred.state, State::good) << blurred.text;
}

TEST(CalibrationVerdict, MirroredImagesAreNamed) {
  std::vector<BoardView> views = sample_views(covered_scene(sample_camera("brown"), 20, 3), 3);
  const auto mirror = [](BoardView& view) {
    for (Corner& corner : view.corners) corner.px.x() = testing::sample_size.width_px - 1.0 - corner.px.x();
  };
  mirror(views[4]);
  const Calibration one = sample_calibration(views);
  EXPECT_FALSE(one.views[4].used) << "alone it would draw cx to the other side";
  EXPECT_THAT(one.views[4].reason, HasSubstr("seen from behind, unlike the others'"));
  for (std::size_t k = 0; k < views.size(); k += 2)
    if (k != 4) mirror(views[k]);
  const Calibration half = sample_calibration(views);
  EXPECT_EQ(check_named(half.verdict, "mirrored").state, State::care);
  EXPECT_THAT(check_named(half.verdict, "mirrored").text, HasSubstr("10 of 20 boards, the first in " + views[0].photo));
  EXPECT_THAT(half.verdict.to_add, HasSubstr("from left to right"));
  for (std::size_t k = 0; k < views.size(); k += 2) mirror(views[k]);
  EXPECT_EQ(check_named(sample_calibration(views).verdict, "mirrored").state, State::good);
  std::ranges::for_each(views, mirror);
  const Calibration all = sample_calibration(views);
  EXPECT_EQ(all.verdict.state, State::care);
  EXPECT_THAT(all.verdict.sentence, HasSubstr("all boards are seen from behind"));
}

TEST(CalibrationVerdict, CornersWorseThanTheirSigmaAreFlagged) {
  auto views = clean_views(2);
  for (BoardView& view : views) {
    for (Corner& corner : view.corners) corner.cov /= 25.0;  // five times too sure
  }
  const Check corners = check_named(sample_calibration(views).verdict, "honest corners");
  EXPECT_EQ(corners.state, State::care) << corners.text;
  EXPECT_NEAR(corners.value, 5.0, 0.25);  // 2160 coordinates: 1.5 % a σ; 129 parameters take up 3 %
}

TEST(CalibrationVerdict, ABentBoardIsNamedAndTheWayOutHelps) {
  const auto views = sample_views(covered_scene(sample_camera("brown"), 20, 4, 0.0015), 4);
  const Calibration flat = sample_calibration(views, {.board_shape = BoardShape::flat});
  EXPECT_NE(flat.verdict.state, State::good) << flat.verdict.sentence;
  EXPECT_THAT(check_named(flat.verdict, "board flat").text, HasSubstr("the board bends"));
  EXPECT_THAT(flat.verdict.sentence, HasSubstr("the board bends"));
  EXPECT_THAT(flat.verdict.to_add, HasSubstr("--board-shape bow"));  // which it is
  const Calibration shaped = sample_calibration(views, {.board_shape = BoardShape::bow});
  EXPECT_EQ(shaped.config.board_shape, BoardShape::bow);
  EXPECT_EQ(shaped.verdict.state, State::good) << shaped.verdict.sentence;
  EXPECT_LT(shaped.rms_px, 0.7 * flat.rms_px);
}

TEST(CalibrationVerdict, AShapeThatDoesNotTransferIsNotUsed) {
  const Calibration result = sample_calibration(clean_views(6), {.board_shape = BoardShape::free});
  EXPECT_EQ(result.config.board_shape, BoardShape::flat);
  EXPECT_EQ(result.board_points, points_in_board(testing::sample_board));
  EXPECT_EQ(result.verdict.state, State::good) << result.verdict.sentence;
}

TEST(CalibrationVerdict, ALensThatIsTooPlainIsNamed) {
  const auto views = clean_views(3);
  const Calibration result = sample_calibration(views, {.model = "pinhole"});
  const Check& lens = check_named(result.verdict, "lens adequate");
  EXPECT_NE(lens.state, State::good);
  EXPECT_NE(result.verdict.state, State::good);
  EXPECT_THAT(lens.text, HasSubstr("lowers the held-out error"));
  EXPECT_FALSE(result.verdict.to_add.empty());
}

TEST(CalibrationVerdict, TwoCamerasInOneSetAreNotGood) {
  const Camera other = sample_camera("brown", {{"fx", 530.0}, {"fy", 531.0}, {"cx", 335.0}});
  const auto others = sample_views(sample_scene(other, 20, 17), 17);
  auto alternating = clean_views(7), halves = alternating;
  for (std::size_t k = 1; k < 20; k += 2) alternating[k] = others[k];
  for (std::size_t k = 10; k < 20; ++k) halves[k] = others[k];
  const Calibration mixed = sample_calibration(alternating);
  EXPECT_NE(check_named(mixed.verdict, "consistent").state, State::good);
  EXPECT_NE(mixed.verdict.state, State::good);
  // One camera after the other: even and odd photos are alike; that the corners fit worse than they should shows it.
  EXPECT_NE(sample_calibration(halves).verdict.state, State::good);
}

/// Halves that were not compared are not said to differ.
TEST(CalibrationVerdict, AdviceOnHalvesIsOfWhatWasCompared) {
  auto views = clean_views(1);
  views.resize(6);
  EXPECT_TRUE(sample_calibration(views).study.halves);
  views.resize(5);
  const Calibration few = sample_calibration(views);
  ASSERT_FALSE(few.study.halves);
  EXPECT_EQ(check_named(few.verdict, "consistent").text, "too few photos to compare two halves");
  // Without a photo to propose: this is what is left to advise.
  const Verdict verdict = calibration_verdict(few, few.study, views, few.config, {});
  EXPECT_EQ(verdict.to_add, "add photos: from six on two halves are compared");
}

TEST(CalibrationVerdict, ARefusalSaysWhatToAdd) {
  auto views = clean_views(1);
  views.resize(2);
  const Calibration result = sample_calibration(views);
  EXPECT_EQ(result.verdict.state, State::refused);
  EXPECT_EQ(result.verdict.exit_code, ExitCode::undetermined);
  EXPECT_EQ(static_cast<int>(result.verdict.exit_code), 4);
  EXPECT_THAT(result.verdict.sentence, HasSubstr("only 2 usable photos"));
  EXPECT_FALSE(result.verdict.to_add.empty());
}

TEST(CalibrationVerdict, NoConvergenceIsItsOwnExitCode) {
  // The start is so near that one iteration ends here: the solve must be given none.
  const Calibration result = sample_calibration(clean_views(1), {.max_iterations = 0});
  EXPECT_EQ(result.verdict.state, State::not_converged) << result.verdict.sentence;
  EXPECT_EQ(static_cast<int>(result.verdict.exit_code), 5);
  EXPECT_FALSE(result.verdict.to_add.empty());
}

}  // namespace
}  // namespace alidade
