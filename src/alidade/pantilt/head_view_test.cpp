#include "alidade/pantilt/head_view.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "alidade/geometry/degree.h"

namespace alidade {
namespace {

std::vector<double> pans_after_unwrapping(const std::vector<double>& pans_deg) {
  std::vector<HeadView> views;
  for (const double pan_deg : pans_deg) views.push_back({{}, 0, 1, {pan_deg * degree, 0.1}});
  views.push_back({{}, 0, 2, {2.0, 0.1}});
  unwrap_readings(views);
  EXPECT_EQ(views.back().pan_tilt_rad, Eigen::Vector2d(2.0, 0.1)) << "another head";
  views.pop_back();
  std::vector<double> after_deg;
  for (const HeadView& view : views) after_deg.push_back(std::round(view.pan_tilt_rad.x() / degree * 1e9) / 1e9);
  return after_deg;
}

TEST(UnwrappedReadings, AreOfOneArcAboutZero) {
  EXPECT_EQ(pans_after_unwrapping({0, 340, 20, 359.9, 330, 30}), (std::vector<double>{0, -20, 20, -0.1, -30, 30}));
  EXPECT_EQ(pans_after_unwrapping({170, -170, -140, 150}), (std::vector<double>{-190, -170, -140, -210}))
      << "at half a turn";
  EXPECT_EQ(pans_after_unwrapping({0, 120, 60, 240, 300, 359}), (std::vector<double>{0, 120, 60, -120, -60, -1}));
  EXPECT_EQ(pans_after_unwrapping({250, 300, 280}), (std::vector<double>{-110, -60, -80}));
}

TEST(UnwrappedReadings, StayWhereTheyMayBeMeantSo) {
  const std::vector<std::vector<double>> as_meant = {
      {-100, 100, 90}, {-150, -20, 20, 150}, {-200, -90, 0, 100, 200}, {0, 30, 60, 90, 120, 150, 180, 210},
      {-60, 60, 0},    {100, 150, 200, 250}};
  for (const std::vector<double>& pans_deg : as_meant) EXPECT_EQ(pans_after_unwrapping(pans_deg), pans_deg);
}

TEST(AngleNear, IsTheSameDirectionWithinHalfATurn) {
  EXPECT_EQ(angle_near(0.3, 0.0), 0.3);
  EXPECT_NEAR(angle_near(6.2, 0.0), 6.2 - 2.0 * std::numbers::pi, 1e-15);
  EXPECT_NEAR(angle_near(0.1, 18.8), 0.1 + 6.0 * std::numbers::pi, 1e-14);
  EXPECT_EQ(reading_after(12.0, 0.0), 12.0) << "counts on, or is in degrees";
  EXPECT_TRUE(std::isnan(angle_near(std::nan(""), 1.0)));
}

}  // namespace
}  // namespace alidade
