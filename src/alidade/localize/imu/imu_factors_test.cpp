#include "alidade/localize/imu/imu_factors.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <array>

#include "alidade/simulate/imu/imu_readings.h"

namespace alidade {
namespace {

Rigid3 path_at(double t) {
  return {exp_so3(Eigen::Vector3d(0.4 * std::sin(1.3 * t), 0.3 * std::cos(0.9 * t), 0.5 * std::sin(0.7 * t + 0.3))),
          {0.3 * std::sin(2.1 * t), 0.2 * std::cos(1.7 * t), 0.25 * std::sin(1.1 * t)}};
}

struct Window {
  ImuScene scene;
  ImuState state;
  std::array<Rigid3, 3> poses;
  std::array<ImuStepAt, 2> steps;
};

/// Three poses a twentieth and a tenth of a second apart, with an IMU whose errors are what the state says.
Window window() {
  Window out;
  ImuScene& scene = out.scene;
  scene.noise = {.rate_density = 0.0, .force_density = 0.0, .rate_walk = 0.0, .force_walk = 0.0};
  scene.rate_hz = 1000.0;
  scene.mounting.cam_from_imu = {exp_so3({0.02, -0.01, 0.03}), {0.05, -0.03, 0.02}};
  scene.late_s = 0.004;
  scene.force_scale = 0.01;
  scene.force_axes << 0.02, -0.01, 0.015, 0.005, -0.012, 0.01, -0.008, 0.006, -0.008;
  scene.rate_axes << 0.004, 0.003, -0.002, 0.003, -0.005, 0.001, -0.002, 0.001, 0.003;
  const ImuSequence imu = simulate_imu(scene, path_at, 0.0, 2.0, 1);
  const std::array<double, 3> t_s{1.0, 1.05, 1.15};
  const Eigen::Matrix3d R = scene.mounting.cam_from_imu.rotation.toRotationMatrix();
  ImuState& state = out.state;
  state.node_t_s = {0.5, 1.07, 1.5};  // a node inside the window
  for (int i = 0; i < 3; ++i) {
    state.rate_bias.push_back(scene.rate_bias);
    state.force_bias.push_back(scene.force_bias);
  }
  state.gravity_in_world = scene.gravity_in_world;
  state.turn = Eigen::Quaterniond(R);
  state.imu_in_cam = scene.mounting.cam_from_imu.translation;
  state.late_s = scene.late_s;
  state.force_scale = scene.force_scale;
  const Eigen::Matrix3d one = Eigen::Matrix3d::Identity();
  state.force_axes = (one + scene.force_axes).inverse() - one;
  state.rate_axes = (one + scene.rate_axes).inverse() - one;
  for (std::size_t k = 0; k < 3; ++k) out.poses[k] = path_at(t_s[k]);
  for (std::size_t k = 0; k < 2; ++k) {
    ImuStepAt& at = out.steps[k];
    at.rate_bias = scene.rate_bias + Eigen::Vector3d(1e-3, -2e-3, 1e-3);
    at.force_bias = scene.force_bias + Eigen::Vector3d(-2e-3, 1e-3, 3e-3);
    at.t_s = 0.5 * (t_s[k] + t_s[k + 1]);
    at.step = *preintegrated(imu.readings, t_s[k], t_s[k + 1], 0.01, at.rate_bias, at.force_bias);
  }
  return out;
}

ImuRows rates(const Window& w, const std::array<Rigid3, 3>& poses, const ImuState& state) {
  return rotation_rows(w.steps[0], std::span<const Rigid3, 2>(poses.data(), 2), state);
}
ImuRows forces(const Window& w, const std::array<Rigid3, 3>& poses, const ImuState& state) {
  return force_rows(w.steps[0], w.steps[1], poses, state);
}

/// Errors that remain are those of means between readings and of a clock's second order.
TEST(ImuFactors, TheTruthLeavesNothing) {
  const Window w = window();
  EXPECT_LT(rates(w, w.poses, w.state).error.norm(), 2e-5);
  EXPECT_LT(forces(w, w.poses, w.state).error.norm(), 2e-4);  // of changes of 1.5 m/s
}

template <typename Rows>
void expect_derivatives(const Rows& rows_of, const Window& w) {
  constexpr double h = 1e-6, close = 2e-6;
  const ImuRows rows = rows_of(w, w.poses, w.state);
  for (int i = 0; i < 18; ++i) {
    const auto moved = [&](double by) {
      std::array<Rigid3, 3> poses = w.poses;
      Rigid3& pose = poses[static_cast<std::size_t>(i / 6)];
      if (i % 6 < 3) pose.translation[i % 3] += by;
      if (i % 6 >= 3) pose.rotation = pose.rotation * exp_so3(by * Eigen::Vector3d::Unit(i % 3));
      return rows_of(w, poses, w.state).error;
    };
    const Eigen::Vector3d J = (moved(h) - moved(-h)) / (2.0 * h);
    EXPECT_LT((J - rows.J_poses.col(i)).norm(), close * (1.0 + J.norm())) << "pose " << i;
  }
  for (int i = 0; i < w.state.dim(); ++i) {
    const auto moved = [&](double by) {
      return rows_of(w, w.poses, w.state.moved(by * Eigen::VectorXd::Unit(w.state.dim(), i))).error;
    };
    const Eigen::Vector3d J = (moved(h) - moved(-h)) / (2.0 * h);
    EXPECT_LT((J - rows.J_imu.col(i)).norm(), close * (1.0 + J.norm())) << "imu " << i;
  }
}

TEST(ImuFactors, DerivativesAreThoseOfDifferences) {
  Window w = window();
  w.state.late_s += 0.002;  // off the truth, where errors are not zero
  w.state.rate_bias[1] += Eigen::Vector3d(0.01, 0.02, -0.01);
  w.state.force_bias[0] += Eigen::Vector3d(0.1, -0.2, 0.1);
  w.poses[1].translation += Eigen::Vector3d(0.01, -0.02, 0.01);
  w.poses[1].rotation = w.poses[1].rotation * exp_so3({0.03, -0.02, 0.01});
  expect_derivatives(rates, w);
  expect_derivatives(forces, w);
}

/// Against draws: of white noise, and its sum over neighbours, which is what slow accelerations meet.
TEST(ImuFactors, TheVarianceIsThatOfSlowSums) {
  ImuScene scene = window().scene;
  scene.mounting.cam_from_imu = {};
  scene.late_s = scene.force_scale = 0.0;
  scene.force_axes.setZero();
  scene.rate_axes.setZero();
  scene.rate_bias.setZero();
  scene.force_bias.setZero();
  scene.rate_hz = 300.0;
  scene.noise.rate_density = 1e-3;
  scene.noise.force_density = 1e-2;
  constexpr double frame_s = 0.1;
  constexpr int num_frames = 40, num_draws = 60;
  ImuState state;
  state.node_t_s = {0.0};
  state.rate_bias = state.force_bias = {Eigen::Vector3d::Zero()};
  state.gravity_in_world = scene.gravity_in_world;
  double of_rates = 0.0, of_sums = 0.0;
  const auto rest = [](double) { return Rigid3{}; };
  for (int draw = 0; draw < num_draws; ++draw) {
    const ImuSequence imu = simulate_imu(scene, rest, 0.0, frame_s * num_frames, static_cast<std::uint64_t>(draw) + 1);
    std::vector<ImuStepAt> steps;
    for (int k = 0; k + 1 < num_frames; ++k) {
      ImuStepAt at;
      at.step = *preintegrated(imu.readings, k * frame_s, (k + 1) * frame_s, 0.02, at.rate_bias, at.force_bias);
      steps.push_back(at);
    }
    const std::array<Rigid3, 3> poses{};
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k + 1 < steps.size(); ++k) {
      sum += force_rows(steps[k], steps[k + 1], poses, state).error;
      const ImuRows rows = rotation_rows(steps[k], std::span<const Rigid3, 2>(poses.data(), 2), state);
      of_rates += rows.error.squaredNorm() / (3.0 * rotation_variance(steps[k].step, scene.noise));
    }
    const double num = static_cast<double>(steps.size() - 1);
    of_sums += sum.squaredNorm() / (3.0 * num * force_variance(steps[0].step, steps[1].step, scene.noise));
  }
  EXPECT_NEAR(of_rates / (num_draws * (num_frames - 2)), 1.0, 0.1);
  // 180 numbers: ± 3 √(2/180)
  EXPECT_NEAR(of_sums / num_draws, 1.0, 0.32);
}

}  // namespace
}  // namespace alidade
