#include "alidade/servo/bearing_filter.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alidade/estimation/van_loan.h"
#include "alidade/simulate/draws.h"

namespace alidade {
namespace {

constexpr double sigma_rad = 0.0017, observation_period_s = 0.05;

/// After a start, σ of the angle dt later is that of F P Fᵀ + Q; from the exponential of Van Loan.
TEST(BearingAxis, PredictsAsSingersModel) {
  for (const double dt_s : {0.001, 0.003, 0.0041, 0.02, 0.1, 0.7}) {
    BearingFilterConfig config;
    config.sigma_rad_s2.fill(3.0);
    config.start_rate_rad_s = 1.0;  // less than σ τ: of every model
    BearingAxis axis(config);
    axis.start(0.0, 0.2, sigma_rad * sigma_rad);
    Eigen::Matrix3d A, D = Eigen::Matrix3d::Zero();
    A << 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0 / config.singer_tau_s;
    D(2, 2) = 2.0 * 9.0 / config.singer_tau_s;
    const Discretised<3> step = discretised<3>(A, D, dt_s);
    const Eigen::Matrix3d P0 = Eigen::Vector3d(sigma_rad * sigma_rad, 1.0, 9.0).asDiagonal();
    const Eigen::Matrix3d P = step.F * P0 * step.F.transpose() + step.Q;
    EXPECT_NEAR(axis.at(dt_s).sigma_rad, std::sqrt(P(0, 0)), 1e-6 * std::sqrt(P(0, 0))) << dt_s;
  }
}

TEST(BearingAxis, ExtrapolatesAsItPredicts) {
  BearingFilterConfig config;
  BearingAxis axis(config);
  axis.start(0.0, 0.0, sigma_rad * sigma_rad);
  for (int k = 1; k < 20; ++k)
    axis.update(k * observation_period_s, 0.3 * std::sin(2.0 * k * observation_period_s), sigma_rad * sigma_rad);
  const Bearing there = ahead(axis.at(0.95), config.singer_tau_s, 0.2), predicted = axis.at(1.15);
  EXPECT_NEAR(there.angle_rad, predicted.angle_rad, 1e-12);
  EXPECT_NEAR(there.rate_rad_s, predicted.rate_rad_s, 1e-12);
}

double rms_ahead(double amplitude_rad, double omega, const BearingFilterConfig& config, double ahead_s) {
  Draws draws(3);
  BearingAxis axis(config);
  axis.start(0.0, 0.0, sigma_rad * sigma_rad);
  double sum2 = 0.0;
  for (int k = 1; k <= 600; ++k) {
    const double t_s = k * observation_period_s;
    axis.update(t_s, amplitude_rad * std::sin(omega * t_s) + sigma_rad * draws.normal(), sigma_rad * sigma_rad);
    const double error = axis.at(t_s + ahead_s).angle_rad - amplitude_rad * std::sin(omega * (t_s + ahead_s));
    if (k > 40) sum2 += error * error;
  }
  return std::sqrt(sum2 / 560.0);
}

/// Nobody says how manoeuvring the target is, and it costs at most a quarter against the best of 25 single σ.
TEST(BearingAxis, FindsTheTargetsLiveliness) {
  struct Case {
    double amplitude_rad, omega;
  };
  for (const auto& [amplitude_rad, omega] : {Case{0.15, 0.63}, Case{0.3, 2.1}, Case{0.45, 3.1}}) {
    for (const double ahead_s : {0.0, 0.1}) {
      double best = 1.0;
      for (double sigma = 0.03; sigma < 60.0; sigma *= 1.37) {
        BearingFilterConfig one;
        one.sigma_rad_s2.fill(sigma);
        best = std::min(best, rms_ahead(amplitude_rad, omega, one, ahead_s));
      }
      EXPECT_LT(rms_ahead(amplitude_rad, omega, {}, ahead_s), 1.25 * best) << amplitude_rad << " " << ahead_s;
    }
  }
}

TEST(BearingFilter, LeavesOutOneWildObservationAndFollowsAJump) {
  Draws draws(1);
  BearingFilter filter({});
  const auto take = [&](double t_s, const Eigen::Vector2d& where) {
    return filter.take(t_s, where + sigma_rad * draws.normal2(), sigma_rad);
  };
  const Eigen::Vector2d here(0.1, -0.2), there(0.27, -0.12);
  EXPECT_EQ(take(0.0, here), ObservationUse::started);
  int k = 1;
  for (; k < 40; ++k) EXPECT_EQ(take(k * observation_period_s, here), ObservationUse::used);
  EXPECT_EQ(take(k++ * observation_period_s, there), ObservationUse::gated);  // one wild observation…
  EXPECT_EQ(take(k * observation_period_s, here), ObservationUse::used);
  EXPECT_NEAR(filter.at(k++ * observation_period_s)[0].angle_rad, here.x(), 3e-3);
  EXPECT_EQ(take(k++ * observation_period_s, there), ObservationUse::gated);  // …and a jump
  EXPECT_EQ(take(k * observation_period_s, there), ObservationUse::restarted);
  // The jump is no motion: nothing is carried on.
  EXPECT_NEAR(filter.at(k * observation_period_s + 0.2)[0].angle_rad, there.x(), 4.0 * sigma_rad);
  EXPECT_EQ(filter.take((k - 3) * observation_period_s, there, sigma_rad), ObservationUse::late);
  const double nan = std::nan("");
  EXPECT_EQ(filter.take((k + 1) * observation_period_s, {nan, nan}, sigma_rad), ObservationUse::gated);
}

/// A persistent lens error: σ of the filter is right with it included, and far too small without.
TEST(BearingAxis, CountsWhatTheLensHasWrong) {
  constexpr int num_runs = 400;
  constexpr double of_focal_rad = 0.004, of_centre_rad = 0.006;
  double counted = 0.0, left_out = 0.0;
  for (std::uint64_t run = 0; run < num_runs; ++run) {
    Draws draws(100 + run);
    const double focal = draws.normal(), centre = draws.normal();
    BearingFilterConfig config;
    config.sigma_rad_s2.fill(0.5);
    BearingAxis with(config), without(config);
    double state[3] = {0.0, 0.0, 0.5 * draws.normal()};  // a target that moves as the model has it
    const double dt = observation_period_s, a = dt / config.singer_tau_s;
    for (int k = 0; k <= 60; ++k) {
      const LensEffect effect(of_focal_rad * std::sin(0.2 * k), of_centre_rad);
      const double z = state[0] + effect[0] * focal + effect[1] * centre + sigma_rad * draws.normal();
      if (k == 0) {
        with.start(0.0, z, sigma_rad * sigma_rad, effect);
        without.start(0.0, z, sigma_rad * sigma_rad);
      } else {
        with.update(k * dt, z, sigma_rad * sigma_rad, effect);
        without.update(k * dt, z, sigma_rad * sigma_rad);
      }
      if (k == 60) break;
      state[0] += dt * state[1] + config.singer_tau_s * config.singer_tau_s * (a - 1.0 + std::exp(-a)) * state[2];
      state[1] += config.singer_tau_s * (1.0 - std::exp(-a)) * state[2];
      state[2] = std::exp(-a) * state[2] + 0.5 * std::sqrt(1.0 - std::exp(-2.0 * a)) * draws.normal();
    }
    const Bearing given = with.at(60 * dt), naive = without.at(60 * dt);
    counted += std::pow((given.angle_rad - state[0]) / given.sigma_rad, 2) / num_runs;
    left_out += std::pow((naive.angle_rad - state[0]) / naive.sigma_rad, 2) / num_runs;
  }
  EXPECT_NEAR(counted, 1.0, 3.0 * std::sqrt(2.0 / num_runs));
  EXPECT_GT(left_out, 5.0);
}

}  // namespace
}  // namespace alidade
