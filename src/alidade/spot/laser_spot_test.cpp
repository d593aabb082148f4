#include "alidade/spot/laser_spot.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "alidade/simulate/draws.h"

namespace alidade {
namespace {

/// An image painted pixel by pixel: independent of the renderer, so that each case is one thing.
struct Painting {
  cv::Mat light{cv::Size(160, 120), CV_32FC3, cv::Scalar(90, 90, 90)};
  Draws draws{1};

  /// Vertical stripes of ink and paper, wide as a square, with blurred edges.
  void print_stripes(int width_px) {
    for (int v = 0; v < light.rows; ++v)
      for (int u = 0; u < light.cols; ++u)
        light.at<cv::Vec3f>(v, u) = cv::Vec3f::all((u / width_px) % 2 == 0 ? 25.0F : 120.0F);
    cv::GaussianBlur(light, light, cv::Size(), 0.7);
  }
  void add_spot(const Eigen::Vector2d& px, double radius_px, double peak, int channel = 2, double leak = 0.12) {
    for (int v = 0; v < light.rows; ++v) {
      for (int u = 0; u < light.cols; ++u) {
        const double square = (Eigen::Vector2d(u, v) - px).squaredNorm() / (radius_px * radius_px);
        for (int k = 0; k < 3; ++k)
          light.at<cv::Vec3f>(v, u)[k] +=
              static_cast<float>((k == channel ? 1.0 : leak) * peak * std::exp(-0.5 * square));
      }
    }
  }
  /// Adds noise and rounds.
  [[nodiscard]] cv::Mat photo(double noise = 2.0) {
    cv::Mat noisy = light.clone();
    for (int v = 0; v < noisy.rows; ++v)
      for (int u = 0; u < noisy.cols; ++u)
        for (int k = 0; k < 3; ++k) noisy.at<cv::Vec3f>(v, u)[k] += static_cast<float>(noise * draws.normal());
    cv::Mat photo;
    noisy.convertTo(photo, CV_8UC3);
    return photo;
  }
};

TEST(LaserSpot, RedAndGreenAreFoundByTheirColour) {
  for (const int channel : {1, 2}) {
    Painting painting;
    painting.add_spot({70.3, 51.8}, 2.0, 80.0, channel);
    const LaserSpot spot = find_laser_spot(painting.photo());
    ASSERT_TRUE(spot.found()) << spot.reason;
    const Eigen::Vector2d error = spot.px - Eigen::Vector2d(70.3, 51.8);
    EXPECT_LT(error.dot(spot.cov.inverse() * error), 18.4);  // χ² of 2 at 1e-4
    EXPECT_LT(std::sqrt(spot.cov.trace()), 0.15);
    EXPECT_NEAR(spot.radius_px, 2.0, 0.2);
    EXPECT_NEAR(spot.peak, 80.0, 16.0);  // less the leak: an eighth
    EXPECT_FALSE(spot.is_saturated);
    EXPECT_FALSE(spot.is_on_edge);
  }
}

TEST(LaserSpot, AnotherColourIsNotTheOneAskedFor) {
  Painting painting;
  painting.add_spot({70.3, 51.8}, 2.0, 80.0, 1, 0.0);
  EXPECT_EQ(find_laser_spot(painting.photo(), {}, {.colour = SpotColour::red}).reason, "no laser spot");
  EXPECT_TRUE(find_laser_spot(painting.photo(), {}, {.colour = SpotColour::green}).found());
}

TEST(LaserSpot, SixteenBitsAreAsGoodAsEight) {
  Painting painting;
  painting.add_spot({70.3, 51.8}, 2.0, 80.0);
  cv::Mat photo;
  painting.photo().convertTo(photo, CV_16UC3, 16.0);  // a 12-bit camera
  const LaserSpot spot = find_laser_spot(photo);
  ASSERT_TRUE(spot.found()) << spot.reason;
  EXPECT_LT((spot.px - Eigen::Vector2d(70.3, 51.8)).norm(), 0.15);
}

TEST(LaserSpot, AWhiteCentreInAColouredHaloIsSaturated) {
  Painting painting;
  painting.add_spot({70.3, 51.8}, 3.0, 3000.0);
  const LaserSpot spot = find_laser_spot(painting.photo());
  ASSERT_TRUE(spot.found()) << spot.reason;
  EXPECT_TRUE(spot.is_saturated);
  EXPECT_LT((spot.px - Eigen::Vector2d(70.3, 51.8)).norm(), 0.1);
}

TEST(LaserSpot, TwoSpotsAreNamed) {
  Painting painting;
  painting.add_spot({40.0, 30.0}, 2.0, 90.0);
  painting.add_spot({110.0, 80.0}, 2.0, 60.0);
  EXPECT_EQ(find_laser_spot(painting.photo()).reason, "two candidates at (40, 30) and (110, 80)");
}

TEST(LaserSpot, ARedAndAGreenSpotAreTwo) {
  Painting painting;
  painting.add_spot({40.0, 30.0}, 2.0, 90.0, 2);
  painting.add_spot({110.0, 80.0}, 2.0, 70.0, 1);
  EXPECT_EQ(find_laser_spot(painting.photo()).reason, "two candidates at (40, 30) and (110, 80)");
  EXPECT_TRUE(find_laser_spot(painting.photo(), {}, {.colour = SpotColour::green}).found());
}

TEST(LaserSpot, HotPixelsHighlightsAndStreaksAreNoSpots) {
  Painting painting;
  painting.light.at<cv::Vec3f>(30, 40) = {90, 90, 250};                      // a hot red pixel
  painting.light.at<cv::Vec3f>(80, 20) = {90, 255, 90};                      // and a green one
  painting.add_spot({100.0, 60.0}, 4.0, 400.0, 2, 1.0);                      // a white highlight
  painting.light(cv::Rect(20, 100, 100, 2)).setTo(cv::Scalar(90, 90, 200));  // a red ribbon
  EXPECT_EQ(find_laser_spot(painting.photo()).reason, "no laser spot");
  painting.add_spot({70.3, 51.8}, 2.0, 80.0);
  const LaserSpot spot = find_laser_spot(painting.photo());
  ASSERT_TRUE(spot.found()) << spot.reason;
  EXPECT_LT((spot.px - Eigen::Vector2d(70.3, 51.8)).norm(), 0.15);
}

TEST(LaserSpot, AHotPixelInTheSpotsHaloDoesNotPullIt) {
  Painting painting;
  painting.add_spot({70.3, 51.8}, 2.0, 80.0);
  painting.light.at<cv::Vec3f>(58, 76) = {90, 90, 255};
  const LaserSpot spot = find_laser_spot(painting.photo());
  ASSERT_TRUE(spot.found()) << spot.reason;
  EXPECT_LT((spot.px - Eigen::Vector2d(70.3, 51.8)).norm(), 0.15);
}

TEST(LaserSpot, ColouredThingsBesideTheRegionAreNotLookedAt) {
  Painting painting;
  painting.add_spot({70.3, 51.8}, 2.0, 80.0);
  painting.add_spot({130.0, 100.0}, 3.0, 80.0);
  EXPECT_FALSE(find_laser_spot(painting.photo()).found());
  LaserSpotAids aids;
  aids.region = {{40, 20}, {110, 20}, {110, 80}, {40, 80}};
  EXPECT_TRUE(find_laser_spot(painting.photo(), aids).found());
  aids.region = {{400, 20}, {410, 20}, {410, 80}};
  EXPECT_EQ(find_laser_spot(painting.photo(), aids).reason, "the region lies outside the photo");
}

TEST(LaserSpot, ASpotOnTheBorderIsNamed) {
  Painting painting;
  painting.add_spot({70.0, 1.0}, 2.0, 80.0);
  EXPECT_EQ(find_laser_spot(painting.photo()).reason.substr(0, 20), "the laser spot at (7");
  EXPECT_NE(find_laser_spot(painting.photo()).reason.find("is cut by the photo's border"), std::string::npos);
}

TEST(LaserSpot, WhatCannotBeDeterminedIsNamed) {
  Painting painting;
  painting.light.setTo(cv::Scalar(300, 300, 300));
  EXPECT_EQ(find_laser_spot(painting.photo()).reason, "the photo is blown out");
  EXPECT_EQ(find_laser_spot(cv::Mat()).reason, "there is no image");
  const cv::Mat grey(120, 160, CV_8UC1, cv::Scalar(90)), small(60, 80, CV_8UC1, cv::Scalar(90));
  EXPECT_EQ(find_laser_spot(grey).reason,
            "a grey photo shows no spot without the photo with the laser off or a chessboard's pose");
  LaserSpotAids aids;
  aids.photo_off = &small;
  EXPECT_EQ(find_laser_spot(grey, aids).reason, "the photo with the laser off has another size or kind");
  EXPECT_EQ(find_laser_spot(cv::Mat(120, 160, CV_8UC3, cv::Scalar(0, 0, 0))).reason, "no laser spot");
}

TEST(LaserSpot, ThePhotoWithTheLaserOffMayBeMovedAndExposedOtherwise) {
  Painting lit, dark;
  lit.print_stripes(14);
  dark.print_stripes(14);
  const cv::Matx23f shift(1.0F, 0.0F, 0.6F, 0.0F, 1.0F, 0.0F);
  cv::warpAffine(dark.light, dark.light, shift, dark.light.size(), cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  dark.light = 1.15 * dark.light + cv::Scalar(4, 4, 4);
  lit.add_spot({91.2, 51.8}, 1.5, 80.0);
  const cv::Mat photo = lit.photo(), photo_off = dark.photo();
  LaserSpotAids aids;
  aids.photo_off = &photo_off;
  const LaserSpot spot = find_laser_spot(photo, aids);
  ASSERT_TRUE(spot.found()) << spot.reason;
  EXPECT_LT((spot.px - Eigen::Vector2d(91.2, 51.8)).norm(), 0.15);
  aids.photo_off = &photo;
  EXPECT_EQ(find_laser_spot(photo, aids).reason, "no laser spot");
}

}  // namespace
}  // namespace alidade
