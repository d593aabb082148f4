#include "alidade/corners/corner_fit.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>

#include "alidade/corners/blurred_edge.h"
#include "alidade/testing/random.h"

namespace alidade {
namespace {

/// A corner drawn by the model itself, in double.
struct DrawnCorner {
  Eigen::Vector2d px = {30.3, 31.8};
  double angle_cols_rad = 0.2, angle_rows_rad = 1.5, blur_px = 0.8, mean = 120.0, contrast = -80.0;
  double bend_cols = 0.0, bend_rows = 0.0;
};

double step_at(const DrawnCorner& corner, double angle_rad, double bend, double x, double y) {
  const double dx = x - corner.px.x(), dy = y - corner.px.y();
  const double along = std::cos(angle_rad) * dx + std::sin(angle_rad) * dy;
  const double distance = std::cos(angle_rad) * dy - std::sin(angle_rad) * dx - 0.5 * bend * along * along;
  return std::erf(distance / (std::numbers::sqrt2 * corner.blur_px));
}

cv::Mat draw(const DrawnCorner& corner) {
  cv::Mat photo(64, 64, CV_32F);
  for (int y = 0; y < photo.rows; ++y) {
    for (int x = 0; x < photo.cols; ++x) {
      photo.at<float>(y, x) = static_cast<float>(
          corner.mean + corner.contrast * step_at(corner, corner.angle_cols_rad, corner.bend_cols, x, y) *
                            step_at(corner, corner.angle_rows_rad, corner.bend_rows, x, y));
    }
  }
  return photo;
}

/// A start that is wrong by half a pixel and by two degrees.
CornerStart start_near(const DrawnCorner& corner, double square_px = 36.0) {
  const double a = corner.angle_cols_rad + 0.035, b = corner.angle_rows_rad - 0.035;
  return {.px = corner.px + Eigen::Vector2d(0.4, -0.3),
          .along_cols = square_px * Eigen::Vector2d(std::cos(a), std::sin(a)),
          .along_rows = square_px * Eigen::Vector2d(std::cos(b), std::sin(b)),
          .bend_cols = corner.bend_cols,
          .bend_rows = corner.bend_rows};
}

TEST(EdgeProfile, IsTheErrorFunctionAndItsBell) {
  int checked = 0;
  for (float z = -6.0f; z <= 6.0f; z += 0.01f) {
    const EdgeProfile profile = edge_profile(Float4{z, z, z, z});
    EXPECT_NEAR(profile.step[2], std::erf(static_cast<double>(z)), 5e-7);  // 1.5e-7 of the formula, and float
    EXPECT_NEAR(profile.bell[1], std::exp(-static_cast<double>(z) * z), 5e-7);
    ++checked;
  }
  EXPECT_GE(checked, 1200);
}

TEST(FitCorner, RecoversWhatWasDrawnFromAWrongStart) {
  int checked = 0;
  for (const double blur_px : {0.5, 0.8, 1.5, 3.0}) {
    for (const double angle_rows_rad : {0.75, 1.2, 1.8, 2.7}) {
      for (const double bend : {0.0, 0.002}) {
        DrawnCorner drawn{.angle_rows_rad = angle_rows_rad, .blur_px = blur_px};
        drawn.bend_cols = bend;
        drawn.bend_rows = -bend;
        const CornerFit fit = fit_corner(draw(drawn), start_near(drawn));
        ASSERT_TRUE(fit.accepted()) << fit.reason;
        EXPECT_LT((fit.px - drawn.px).norm(), 1e-3);        // the last step of the fit is below that
        EXPECT_NEAR(fit.blur_px, blur_px, 0.01 * blur_px);  // the profile is cut at 3.6 blurs
        EXPECT_NEAR(fit.contrast, -drawn.contrast, 0.5);
        ++checked;
      }
    }
  }
  EXPECT_EQ(checked, 32);
}

TEST(FitCorner, ContrastTellsWhichQuadrantIsBright) {
  const DrawnCorner drawn;
  const cv::Mat photo = draw(drawn);
  EXPECT_GT(fit_corner(photo, start_near(drawn)).contrast, 0.0);
  CornerStart mirrored = start_near(drawn);
  mirrored.along_rows = -mirrored.along_rows;  // now the next quadrant lies between the two
  EXPECT_LT(fit_corner(photo, mirrored).contrast, 0.0);
}

TEST(FitCorner, ErrorsAreWhatItsCovarianceSays) {
  auto rng = testing::make_rng();
  std::normal_distribution<float> noise(0.0f, 4.0f);
  std::uniform_real_distribution<> shift(-0.5, 0.5);
  constexpr int runs = 400;
  double chi2 = 0.0;
  for (int i = 0; i < runs; ++i) {
    DrawnCorner drawn{.angle_rows_rad = 0.9};
    drawn.px += Eigen::Vector2d(shift(rng), shift(rng));
    cv::Mat photo = draw(drawn);
    for (float& grey : cv::Mat_<float>(photo)) grey += noise(rng);
    const CornerFit fit = fit_corner(photo, start_near(drawn));
    ASSERT_TRUE(fit.accepted()) << fit.reason;
    const Eigen::Vector2d error = fit.px - drawn.px;
    chi2 += error.dot(fit.cov.inverse() * error);
  }
  EXPECT_NEAR(chi2 / runs, 2.0, 0.5);  // χ²(2): the mean of 400 has σ 0.1; five of them
}

TEST(FitCorner, RefusesWhatIsNoCorner) {
  const CornerStart start{.px = {30.0, 30.0}};
  EXPECT_FALSE(fit_corner(cv::Mat(64, 64, CV_32F, cv::Scalar(90)), start).accepted());
  cv::Mat one_square(64, 64, CV_32F, cv::Scalar(200));
  one_square(cv::Rect(30, 30, 34, 34)).setTo(30);  // the outer corner of a black square
  EXPECT_FALSE(fit_corner(one_square, start).accepted());
  cv::Mat edge(64, 64, CV_32F, cv::Scalar(200));
  edge.rowRange(30, 64).setTo(30);
  EXPECT_FALSE(fit_corner(edge, start).accepted());
  EXPECT_EQ(fit_corner(edge, {.px = {-5.0, 30.0}}).reason, "outside the photo");
  EXPECT_EQ(fit_corner(edge, {.px = {30.0, 30.0}, .along_cols = {20.0, 1.0}, .along_rows = {20.0, 1.5}}).reason,
            "the two edges nearly coincide");
  EXPECT_FALSE(fit_corner(edge, {.px = {std::nan(""), 30.0}}).accepted());
}

TEST(FitCorner, RefusesACornerThatIsPartlyCovered) {
  const DrawnCorner drawn;
  cv::Mat photo = draw(drawn);
  photo(cv::Rect(0, 0, 64, 30)).setTo(255);  // a finger's or a lamp's edge, two pixels from the corner
  EXPECT_FALSE(fit_corner(photo, start_near(drawn)).accepted());
}

}  // namespace
}  // namespace alidade
