#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <string>

#include "alidade/observe.h"
#include "alidade/simulate/rotation.h"

// Angles that are given as exact and have noise, beside pixels that are far better.

namespace alidade {
namespace {

constexpr int wide_px = 640, high_px = 480;
constexpr std::array true_k{600.0, 600.0, 320.0, 240.0};

RotationLog log_of_rough_angles(std::uint64_t seed) {
  RotationScene scene;
  scene.width_px = wide_px;
  scene.height_px = high_px;
  scene.start_px = draw_points(wide_px, high_px, 120, seed);
  scene.intrinsics = [](double) { return RotatingIntrinsics{true_k[0], true_k[1], true_k[2], true_k[3], -0.1}; };
  scene.motion = [](double t_s) { return paper_pan_tilt(t_s, 0.0); };
  RotationLogConfig config;
  config.source = RotationSource::head;
  config.rate_hz = 15.0;
  config.duration_s = 6.0;
  config.sigma_px = 0.04;
  config.sigma_angle_rad = 0.001;
  return simulate_rotation(scene, config, seed);
}

/// Points whose distances are free and a lever of metres explain some of it: f was 30 % off. No head has such a lever.
TEST(UntoldNoise, IsNamedAndNoLeverOfMetres) {
  const RotationLog log = log_of_rough_angles(3);
  ObserveConfig config;
  config.width_px = wide_px;
  config.height_px = high_px;
  const ObserveReport report = observe(log, config);
  EXPECT_NE(report.verdict.state, State::good);
  EXPECT_NE(report.verdict.to_add.find("--rotation noisy --sigma-angle"), std::string::npos) << report.verdict.to_add;
  ASSERT_GE(report.quantities.size(), true_k.size());
  for (std::size_t i = 0; i < true_k.size(); ++i)
    EXPECT_NEAR(report.quantities[i].value, true_k[i], 5.0 * report.quantities[i].sigma) << i;
  for (const ObservedQuantity& quantity : report.quantities)
    EXPECT_FALSE(quantity.name.starts_with("lever")) << quantity.value;
}

/// A camera on a long arm: all is explained by it, and without it f is 5 % to 20 % off.
TEST(UntoldNoise, ALeverOfMetresThatIsThereIsEstimated) {
  constexpr int num_points = 12;
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    RotationScene scene;
    scene.width_px = wide_px;
    scene.height_px = high_px;
    scene.start_px = draw_points(wide_px, high_px, num_points, seed);
    scene.lever_arm_m = {0.0, 0.0, 1.5};
    for (int i = 0; i < num_points; ++i) scene.depth_m.push_back(10.0 + 3.5 * i);
    scene.intrinsics = [](double) { return RotatingIntrinsics{true_k[0], true_k[1], true_k[2], true_k[3], 0.0}; };
    scene.motion = [](double t_s) { return paper_pan_tilt(t_s, 0.0); };
    RotationLogConfig config;
    config.source = RotationSource::head;
    config.with_range = true;
    config.duration_s = 20.0;
    const RotationLog log = simulate_rotation(scene, config, seed);
    ObserveConfig wanted;
    wanted.width_px = wide_px;
    wanted.height_px = high_px;
    const ObserveReport report = observe(log, wanted);
    ASSERT_GE(report.quantities.size(), true_k.size()) << seed;
    for (std::size_t i = 0; i < 2; ++i)
      EXPECT_NEAR(report.quantities[i].value, true_k[i], 5.0 * report.quantities[i].sigma) << seed << " " << i;
    EXPECT_LT(report.quantities[0].sigma, 0.015 * true_k[0]) << seed;
  }
}

}  // namespace
}  // namespace alidade
