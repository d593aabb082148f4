// Where each row's rotation is estimated, around what was measured or without any measurement: is σ what it says, and
// is what is not as assumed found? ALIDADE_TEST_TRIALS=20 draws as many logs of each cause and each kind of rotation,
// one of each cause otherwise.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "alidade/geometry/degree.h"
#include "alidade/observe/solve/solve.h"
#include "alidade/simulate/rotation.h"
#include "alidade/testing/trials.h"

namespace alidade::estimated_rotation {
namespace {

constexpr int width = 780, height = 582, num_points = 16;
constexpr double sigma_angle_rad = 5e-4, sigma_rate_rad_per_s = 2e-3;

struct Case {
  const char* name;
  RotatingIntrinsics camera{};
  RotationFaults faults{};
  double delay_s = 0.0, shutter_s = 0.0, growth_per_s = 0.0;
  Eigen::Vector3d mount_rad = Eigen::Vector3d::Zero(), lever_m = Eigen::Vector3d::Zero();
  bool is_measured = false;  ///< It is something only where the rotation is measured.
};

const std::vector<Case>& cases() {
  static const std::vector<Case> all{
      {.name = "as given"},
      {.name = "k1", .camera = {.k1 = -0.1}},
      {.name = "k1, k2", .camera = {.k1 = -0.2, .k2 = 0.1}},
      {.name = "p1, p2", .camera = {.p1 = 0.004, .p2 = -0.003}},
      {.name = "rolling shutter", .shutter_s = 0.02},
      {.name = "focal length grows", .growth_per_s = 0.002},
      {.name = "lever", .lever_m = {0.05, 0.0, 0.05}},
      {.name = "wrong pixels", .faults = {.wrong_share = 0.05}},
      {.name = "exchanged points", .faults = {.swapped_share = 0.05}},
      {.name = "moving points", .faults = {.moving_share = 0.2}},
      {.name = "errors that last", .faults = {.noise_px = 0.5, .noise_lasts_s = 2.0}},
      {.name = "mount", .mount_rad = {0.02, 0.03, 0.02}, .is_measured = true},
      {.name = "delay", .delay_s = 0.02, .is_measured = true},
      {.name = "scale of the angles", .faults = {.angle_scale = 1.02}, .is_measured = true},
  };
  return all;
}

enum class Rotation { of_head, of_rates, of_attitude, none };

RotationLog log_in(const Case& world, Rotation rotation, std::uint64_t seed) {
  RotationScene scene;
  scene.start_px = draw_points(width, height, num_points, 700 + seed);
  if (!world.lever_m.isZero())
    for (int i = 0; i < num_points; ++i) scene.depth_m.push_back(2.0 + 0.2 * i);
  scene.lever_arm_m = world.lever_m;
  scene.intrinsics = [world](double t_s) {
    RotatingIntrinsics now = world.camera;
    now.fx *= 1.0 + world.growth_per_s * t_s;
    now.fy *= 1.0 + world.growth_per_s * t_s;
    return now;
  };
  scene.delay_s = world.delay_s;
  scene.shutter_s = world.shutter_s;
  scene.mount_rad = world.mount_rad;
  const bool is_rate = rotation == Rotation::of_rates;
  // A hand rolls the camera, too: without that no views determine fx / fy, cx and cy.
  const double roll = rotation == Rotation::of_head ? 0.0 : 0.3;
  scene.motion = [is_rate, roll](double t_s) -> Eigen::Vector3d {
    if (is_rate) return paper_rate(t_s) * 1.5 + Eigen::Vector3d(0.0, 0.0, roll * std::cos(1.1 * t_s));
    return {0.25 * std::sin(1.3 * t_s), 0.18 * std::sin(0.9 * t_s + 1.0), roll * std::sin(1.1 * t_s)};
  };
  RotationLogConfig config;
  config.source = is_rate                             ? RotationSource::rate
                  : rotation == Rotation::of_attitude ? RotationSource::attitude
                                                      : RotationSource::head;
  config.duration_s = 8.0;
  config.rate_hz = 10.0;
  config.sigma_px = 0.3;
  config.clip_to_image = true;
  config.sigma_angle_rad = is_rate || rotation == Rotation::none ? 0.0 : sigma_angle_rad;
  config.sigma_rate_rad_per_s = is_rate ? sigma_rate_rad_per_s : 0.0;
  RotationLog log = simulate_rotation(scene, config, seed);
  add_faults(world.faults, width, height, seed, log);
  if (rotation == Rotation::none) log.source = RotationSource::none;
  return log;
}

ObserveSetup setup_for(Rotation rotation) {
  ObserveSetup config;
  config.estimate_auto = true;
  config.width_px = width;
  config.height_px = height;
  config.rotation = rotation == Rotation::none ? RotationKnowledge::free : RotationKnowledge::noisy;
  config.sigma_angle_rad = sigma_angle_rad;
  config.sigma_rate_rad_per_s = sigma_rate_rad_per_s;
  config.start = Eigen::Vector4d(650.0, 650.0, 0.5 * (width - 1), 0.5 * (height - 1));
  return config;
}

struct Outcome {
  int num = 0, good = 0, silent = 0;
  double worst_good = 0.0;
};

Outcome outcome_of(const Case& world, Rotation rotation, int num, bool shows) {
  Outcome outcome;
  for (; outcome.num < num; ++outcome.num) {
    const RotationLog log = log_in(world, rotation, 1 + static_cast<std::uint64_t>(outcome.num));
    const ObserveSetup config = setup_for(rotation);
    const ObserveSolution report = solve_intrinsics(log, config);
    const Verdict verdict = observe_verdict(report, log, config);
    double worst = 0.0;
    for (std::size_t i = 0; i < 4 && report.status == ObserveSolution::Status::ok; ++i)
      worst = std::max(worst, std::abs(report.quantities[i].value - log.truth.back()[i]) / report.quantities[i].sigma);
    if (shows)
      std::printf("    %s %.1f | %s | %s\n", verdict.state == State::good ? "good" : "not good", worst,
                  verdict.sentence.c_str(), verdict.to_add.c_str());
    if (verdict.state != State::good) continue;
    ++outcome.good;
    outcome.worst_good = std::max(outcome.worst_good, worst);
    outcome.silent += worst > 5.0;
  }
  return outcome;
}

class EstimatedRotation : public ::testing::TestWithParam<Rotation> {};

TEST_P(EstimatedRotation, NothingWrongIsSilent) {
  const int num = alidade::testing::trials(1);
  const bool shows = std::getenv("ALIDADE_SHOW") != nullptr;
  for (std::size_t i = 0; i < cases().size(); ++i) {
    const Case& world = cases()[i];
    const bool is_turn = i == 0 || i % 4 == static_cast<std::size_t>(GetParam());
    if ((world.is_measured && GetParam() == Rotation::none) || (num == 1 && !is_turn)) continue;
    const Outcome outcome = outcome_of(world, GetParam(), num, shows);
    std::printf("  %s: %d of %d good, off by at most %.1f sigma\n", world.name, outcome.good, outcome.num,
                outcome.worst_good);
    EXPECT_EQ(outcome.silent, 0) << world.name;
    if (i == 0) EXPECT_GE(20 * outcome.good, 19 * outcome.num) << world.name;
  }
}

INSTANTIATE_TEST_SUITE_P(Sources, EstimatedRotation,
                         ::testing::Values(Rotation::of_head, Rotation::of_rates, Rotation::of_attitude,
                                           Rotation::none));

/// A head's long log of many points, its lens and mounting as `world` has them.
RotationLog long_log_in(const Case& world, std::uint64_t seed) {
  RotationScene scene;
  scene.start_px = draw_points(width, height, 60, seed);
  scene.intrinsics = [world](double) { return world.camera; };
  scene.mount_rad = world.mount_rad;
  scene.motion = [](double t_s) -> Eigen::Vector3d {
    return {0.4 * std::sin(0.74 * t_s + 0.3), 0.28 * std::sin(1.26 * t_s), 0.0};
  };
  RotationLogConfig config;
  config.source = RotationSource::head;
  config.duration_s = 25.0;
  config.rate_hz = 10.0;
  config.sigma_px = 0.3;
  config.clip_to_image = true;
  config.sigma_angle_rad = sigma_angle_rad;
  return simulate_rotation(scene, config, seed);
}

/// Before either is estimated, a lever of a metre seems to explain a lens that distorts and is mounted askew, in some
/// logs with a focal length that is a multiple of the right one.
TEST(EstimatedRotationStart, ALensThatDistortsAndIsMountedAskewIsNoLever) {
  Case world{.name = "lens and mount", .camera = {.fx = 620.0, .fy = 620.0, .k1 = -0.3, .k2 = 0.07}};
  const int num = alidade::testing::trials(2);
  for (int i = 0; i < num; ++i) {
    world.mount_rad = {0.035 * (i % 2 == 0 ? 1.0 : -1.0), 0.012, -0.012};
    const RotationLog log = long_log_in(world, 44 + static_cast<std::uint64_t>(i));
    ObserveSetup config = setup_for(Rotation::of_head);
    config.start.reset();
    const ObserveSolution report = solve_intrinsics(log, config);
    ASSERT_EQ(report.status, ObserveSolution::Status::ok) << i;
    EXPECT_LT(report.quantities[0].sigma, 1.0) << i;  // px; the model's is 0.1
    EXPECT_NEAR(report.quantities[0].value, 620.0, 5.0 * report.quantities[0].sigma) << i;
    EXPECT_EQ(observe_verdict(report, log, config).state, State::good) << i;
  }
}

}  // namespace
}  // namespace alidade::estimated_rotation
