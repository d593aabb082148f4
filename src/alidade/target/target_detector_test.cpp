#include "alidade/target/target_detector.h"

#include <gtest/gtest.h>

#include <opencv2/aruco.hpp>
#include <opencv2/imgproc.hpp>

#include "alidade/simulate/draws.h"
#include "alidade/simulate/films/target_video.h"

namespace alidade {
namespace {

/// The first head of the paper's rig, with a distorting lens.
RigHead head() {
  RigHead head = xiahou_rig()[0];
  head.camera.width_px = 320;
  head.camera.height_px = 240;
  return head;
}

constexpr double distance_m = 0.8;

Eigen::Vector3d somewhere(Draws& draws) {
  const double x = draws.uniform(-0.25, 0.25), y = draws.uniform(-0.18, 0.18);  // inside the image
  return {x, y, distance_m * draws.uniform(0.8, 1.2)};
}

/// RMS over √(mean of the stated variance), both of one coordinate; and how many were lost.
struct Accuracy {
  double rms_px = 0.0, stated_px = 0.0;
  int num_lost = 0;
  std::string reason;
};

Accuracy accuracy_of(const TargetLook& look, const FilmedTarget& target, const cv::Mat* pattern, int trials,
                     double noise = 2.0) {
  TargetDetector detector(look, pattern);
  const RigHead seeing = head();
  Draws draws(7);
  Accuracy result;
  int num_found = 0;
  for (int k = 0; k < trials; ++k) {
    const Eigen::Vector3d place = somewhere(draws);
    const cv::Mat frame =
        render_target_frame(seeing, {0.0, 0.0}, place, target, {.noise = noise}, static_cast<std::uint64_t>(k));
    const TargetDetection seen = detector.find(frame);
    const auto truth = project(seeing, {0.0, 0.0}, place);
    if (!seen.found()) {
      ++result.num_lost;
      result.reason = seen.reason;
      continue;
    }
    ++num_found;
    result.rms_px += 0.5 * (seen.px - truth->px).squaredNorm();
    result.stated_px += 0.5 * seen.cov.trace();
  }
  result.rms_px = std::sqrt(result.rms_px / num_found);
  result.stated_px = std::sqrt(result.stated_px / num_found);
  return result;
}

TargetLook red() { return {.kind = TargetKind::colour, .rgb = {230.0, 70.0, 20.0}}; }

TEST(TargetDetector, PlacesABallOfAColourToATenthOfAPixel) {
  const Accuracy seen = accuracy_of(red(), {}, nullptr, 60);
  EXPECT_EQ(seen.num_lost, 0) << seen.reason;
  EXPECT_LT(seen.rms_px, 0.1);
  EXPECT_GT(seen.stated_px, 0.5 * seen.rms_px);  // what is stated covers it
  EXPECT_LT(seen.stated_px, 3.0 * seen.rms_px);
}

TEST(TargetDetector, PlacesASmallBallInNoise) {
  const FilmedTarget small{.radius_m = 0.004};  // 1.7 px
  const Accuracy seen = accuracy_of(red(), small, nullptr, 60, 5.0);
  EXPECT_EQ(seen.num_lost, 0) << seen.reason;
  EXPECT_LT(seen.rms_px, 0.15);
  EXPECT_GT(seen.stated_px, 0.5 * seen.rms_px);
}

TEST(TargetDetector, PlacesAWhiteAndABlackBall) {
  for (const bool is_bright : {true, false}) {
    const FilmedTarget ball{.rgb = Eigen::Vector3d::Constant(is_bright ? 250.0 : 2.0)};
    const Accuracy seen = accuracy_of({.kind = is_bright ? TargetKind::bright : TargetKind::dark}, ball, nullptr, 60);
    EXPECT_EQ(seen.num_lost, 0) << seen.reason;
    EXPECT_LT(seen.rms_px, 0.1) << is_bright;
  }
}

/// A card with a white rim, so that the marker's border is seen.
cv::Mat marker_card(int id) {
  cv::Mat marker;
  cv::aruco::drawMarker(cv::aruco::getPredefinedDictionary(cv::aruco::DICT_4X4_50), id, 240, marker);
  cv::copyMakeBorder(marker, marker, 40, 40, 40, 40, cv::BORDER_CONSTANT, cv::Scalar(255));
  return marker;
}

TEST(TargetDetector, PlacesAMarkerWhereItsDiagonalsCross) {
  const cv::Mat card = marker_card(7);
  const Accuracy seen = accuracy_of({.kind = TargetKind::marker, .dictionary = "DICT_4X4_50", .marker_id = 7},
                                    {.radius_m = 0.06, .card = &card}, nullptr, 60);
  EXPECT_EQ(seen.num_lost, 0) << seen.reason;
  EXPECT_LT(seen.rms_px, 0.2);
  EXPECT_GT(seen.stated_px, 0.5 * seen.rms_px);
}

TEST(TargetDetector, DoesNotTakeOneMarkerForAnother) {
  const cv::Mat card = marker_card(8);
  const Accuracy seen = accuracy_of({.kind = TargetKind::marker, .dictionary = "DICT_4X4_50", .marker_id = 7},
                                    {.radius_m = 0.06, .card = &card}, nullptr, 5);
  EXPECT_EQ(seen.num_lost, 5);
}

/// Blocks of grey: an image that is unlike anything else.
cv::Mat patterned_card() {
  Draws draws(3);
  cv::Mat blocks(6, 6, CV_8U), card;
  for (int i = 0; i < 36; ++i) blocks.data[i] = static_cast<unsigned char>(draws.uniform(10.0, 245.0));
  cv::resize(blocks, card, {240, 240}, 0.0, 0.0, cv::INTER_CUBIC);
  return card;
}

TEST(TargetDetector, PlacesAPatternThatGrowsAndShrinks) {
  const cv::Mat card = patterned_card();
  cv::Mat as_seen;  // from 0.8 m, 0.12 m across, f = 338 px: 51 px
  cv::resize(card, as_seen, {51, 51}, 0.0, 0.0, cv::INTER_AREA);
  const Accuracy seen = accuracy_of({.kind = TargetKind::pattern}, {.radius_m = 0.06, .card = &card}, &as_seen, 60);
  EXPECT_LE(seen.num_lost, 2) << seen.reason;  // positions are drawn again: sizes jump by up to 1.5
  EXPECT_LT(seen.rms_px, 0.25);
  EXPECT_GT(seen.stated_px, 0.5 * seen.rms_px);
}

class Nothing : public ::testing::TestWithParam<TargetLook> {};

TEST_P(Nothing, IsFoundWhereNothingIs) {
  const cv::Mat card = patterned_card();
  TargetDetector detector(GetParam(), &card);
  const cv::Mat frame = render_target_frame(head(), {0.0, 0.0}, std::nullopt, {}, {}, 1);
  const TargetDetection seen = detector.find(frame);
  EXPECT_FALSE(seen.found()) << seen.px.transpose() << " score " << seen.score;
}

INSTANTIATE_TEST_SUITE_P(
    Of, Nothing,
    ::testing::Values(red(), TargetLook{.kind = TargetKind::pattern},
                      TargetLook{.kind = TargetKind::marker, .dictionary = "DICT_APRILTAG_36h11", .marker_id = 3}));

TEST(TargetDetector, OfTwoAlikeItSaysThatThereAreTwoUnlessOneIsExpected) {
  const RigHead seeing = head();
  const Eigen::Vector3d left(-0.15, 0.0, distance_m), right(0.15, 0.0, distance_m);
  cv::Mat frame = render_target_frame(seeing, {0.0, 0.0}, left, {}, {}, 1);
  const cv::Mat other = render_target_frame(seeing, {0.0, 0.0}, right, {}, {}, 2);
  other.colRange(160, 320).copyTo(frame.colRange(160, 320));
  TargetDetector detector(red());
  EXPECT_NE(detector.find(frame).reason.find("two candidates"), std::string::npos);
  const Eigen::Vector2d truth = project(seeing, {0.0, 0.0}, right)->px;
  const TargetDetection seen = detector.find(frame, TargetExpectation{truth + Eigen::Vector2d(10.0, 5.0), 5.0});
  ASSERT_TRUE(seen.found()) << seen.reason;
  EXPECT_NEAR((seen.px - truth).norm(), 0.0, 0.3);
}

TEST(TargetDetector, ABallAtTheEdgeIsNotPlaced) {
  const RigHead seeing = head();
  const Eigen::Vector3d half_out(160.0 / 337.84 * distance_m, 0.0, distance_m);
  TargetDetector detector(red());
  EXPECT_EQ(detector.find(render_target_frame(seeing, {0.0, 0.0}, half_out, {}, {}, 1)).reason,
            "cut off by the edge of the image");
}

TEST(TargetDetector, LooksThatCannotBeFoundAreRefused) {
  const cv::Mat flat(40, 40, CV_8U, cv::Scalar(90)), tiny(4, 4, CV_8U, cv::Scalar(90));
  EXPECT_THROW(TargetDetector({.kind = TargetKind::colour, .rgb = {90.0, 95.0, 100.0}}), std::invalid_argument);
  EXPECT_THROW(TargetDetector({.kind = TargetKind::colour, .rgb = {900.0, 95.0, 100.0}}), std::invalid_argument);
  EXPECT_THROW(TargetDetector({.kind = TargetKind::marker, .dictionary = "4X4"}), std::invalid_argument);
  EXPECT_THROW(TargetDetector({.kind = TargetKind::marker, .dictionary = "DICT_4X4_50", .marker_id = 50}),
               std::invalid_argument);
  EXPECT_THROW(TargetDetector({.kind = TargetKind::pattern}, &flat), std::invalid_argument);
  EXPECT_THROW(TargetDetector({.kind = TargetKind::pattern}, &tiny), std::invalid_argument);
  EXPECT_THROW(TargetDetector({.kind = TargetKind::pattern}), std::invalid_argument);
}

}  // namespace
}  // namespace alidade
