#include "alidade/camera/port_residual.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

namespace alidade {
namespace {

Camera port_camera(double gap_m, double tilt_deg) {
  const double sin = std::sin(tilt_deg * std::numbers::pi / 180.0);
  Params<FlatPort> p;
  p << 576.0, 576.0, 384.0, 288.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, gap_m, 0.01, 1.5, 1.34, 0.8 * sin, 0.6 * sin;
  return {768, 576, Calibrated<FlatPort>{p}, {}, 0.0, {}};
}

struct Row {
  double gap_m, tilt_deg;
  std::array<double, 4> rms_px;  // at 0.3, 0.5, 1, 3 m
};

// Of another program's fit, printed to two decimals (the last to one): the camera of port_camera().
const std::array<Row, 8> printed{{{0.005, 0, {0.13, 0.06, 0.00, 0.04}},
                                  {0.01, 0, {0.31, 0.13, 0.00, 0.09}},
                                  {0.02, 0, {0.64, 0.28, 0.00, 0.19}},
                                  {0.05, 0, {1.57, 0.69, 0.00, 0.47}},
                                  {0.10, 0, {2.9, 1.3, 0.01, 0.92}},
                                  {0.01, 1, {0.35, 0.22, 0.18, 0.21}},
                                  {0.01, 3, {0.65, 0.58, 0.57, 0.59}},
                                  {0.01, 5, {1.2, 1.1, 1.1, 1.1}}}};

TEST(PortResidual, IsWhatAnotherProgramFinds) {
  for (const Row& row : printed) {
    const auto residual = port_residual(port_camera(row.gap_m, row.tilt_deg));
    ASSERT_TRUE(residual);
    ASSERT_EQ(residual->at.size(), 4u);
    for (std::size_t i = 0; i < 4; ++i) {
      constexpr double half_digit = 0.005;
      EXPECT_NEAR(residual->at[i].rms_px, row.rms_px.at(i), 0.15 * row.rms_px.at(i) + half_digit)
          << 100 * row.gap_m << " cm, " << row.tilt_deg << "°, " << residual->at[i].range_m << " m";
    }
  }
}

TEST(PortResidual, ThePortMovesTheViewpointAlongItsAxis) {
  // 3 mm for a gap of 1 cm, 21 mm for 5 cm; towards the camera's back, as water brings everything nearer.
  EXPECT_NEAR(port_residual(port_camera(0.01, 0))->shift_m.z(), -3.3e-3, 0.5e-3);
  EXPECT_NEAR(port_residual(port_camera(0.05, 0))->shift_m.z(), -21e-3, 1e-3);
  EXPECT_LT(port_residual(port_camera(0.05, 0))->shift_m.head<2>().norm(), 1e-4);
}

TEST(PortResidual, BrownIsEnoughForThinGapsAndStraightPorts) {
  EXPECT_TRUE(port_residual(port_camera(0.005, 0))->brown_is_enough);
  EXPECT_TRUE(port_residual(port_camera(0.02, 0))->brown_is_enough);
  EXPECT_TRUE(port_residual(port_camera(0.01, 1))->brown_is_enough);
  EXPECT_FALSE(port_residual(port_camera(0.05, 0))->brown_is_enough);
  EXPECT_FALSE(port_residual(port_camera(0.01, 3))->brown_is_enough);
}

TEST(PortResidual, IsNoneOfALensWithoutPort) {
  EXPECT_FALSE(port_residual({768, 576, Calibrated<Pinhole>{{576, 576, 384, 288, 0}}, {}, 0.0, {}}));
}

}  // namespace
}  // namespace alidade
