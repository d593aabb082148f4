#include "alidade/servo/axis/axis_mpc.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alidade/servo/axis/axis_observer.h"
#include "alidade/testing/random.h"

namespace alidade {
namespace {

using Wanted = Eigen::Vector<double, mpc_horizon + 1>;
constexpr double period_s = 0.05;

TEST(AxisMpc, IsTheLinearRegulatorWhereNothingLimits) {
  for (const ServoPlant& plant : {ServoPlant(AnglePlant{}), ServoPlant(RatePlant{})}) {
    const ServoAxis axis{plant};
    const AxisModel model = sampled(plant, period_s);
    AxisMpc mpc(axis, model, 2.0);
    const Eigen::RowVector2d K = lqr_gain(model, 2.0);
    const Eigen::Vector2d state(0.01, 0.0);
    const double command = mpc.command(state, 0.0, Wanted::Constant(0.03), Wanted::Zero());
    const double stay = command_between(model, {0.03, 0.0}, {0.03, 0.0});
    // The horizon ends after 10 samples; what comes later counts for 1 %.
    EXPECT_NEAR(command, stay + K.dot(Eigen::Vector2d(0.03, 0.0) - state), 0.01 * std::abs(command));
    EXPECT_LE(mpc.sweeps(), 1);
  }
}

/// For any request, a rate plant is commanded within its limits only: the linear model remains valid.
TEST(AxisMpc, KeepsRateAccelerationAndStops) {
  auto rng = testing::make_rng();
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  ServoAxis axis{RatePlant{}};
  axis.min_rad = -1.0;
  axis.max_rad = 1.0;
  const auto& plant = std::get<RatePlant>(axis.plant);
  const AxisModel model = sampled(axis.plant, period_s);
  int num_fast = 0, num_at_stop = 0;
  for (int run = 0; run < 20; ++run) {
    AxisMpc mpc(axis, model, 2.0);
    AxisMotion motion{0.5 * unit(rng), 0.0};
    double goal = 1.0;
    for (int k = 0; k < 100; ++k) {
      if (k % 25 == 0) goal = 1.3 * unit(rng);
      const Wanted wanted = Wanted::Constant(std::clamp(goal, axis.min_rad, axis.max_rad));
      const double command = mpc.command({motion.angle_rad, motion.rate_rad_s}, 0.0, wanted, Wanted::Zero());
      EXPECT_LE(std::abs(command), plant.max_rate_rad_s + 1e-9);
      EXPECT_LE(std::abs(command - motion.rate_rad_s), plant.tau_s * plant.max_acceleration_rad_s2 + 1e-6);
      const Eigen::Vector2d linear = model.A * Eigen::Vector2d(motion.angle_rad, motion.rate_rad_s) + model.B * command;
      num_fast += std::abs(command) > 0.99 * plant.max_rate_rad_s ? 1 : 0;
      motion = advanced({axis.plant}, motion, command, period_s);
      EXPECT_NEAR(motion.angle_rad, linear[0], 1e-6);
      EXPECT_LT(std::abs(motion.angle_rad), 1.0 + 2e-3);  // 40 sweeps leave this much of a stop
      num_at_stop += std::abs(motion.angle_rad) > 0.99 ? 1 : 0;
    }
    EXPECT_NEAR(motion.angle_rad, std::clamp(goal, -1.0, 1.0), 0.02);
  }
  EXPECT_GT(num_fast, 20);
  EXPECT_GT(num_at_stop, 50);
}

TEST(AxisObserver, FindsWhatTheModelLacks) {
  for (const ServoPlant& known : {ServoPlant(AnglePlant{}), ServoPlant(RatePlant{})}) {
    const ServoAxis as_known{known}, as_it_is{scaled(known, 0.8, 1.3)};
    AxisObserver observer(as_known, sampled(known, period_s), 1e-4);
    observer.start(0.0);
    DelayedAxis axis(as_it_is, {});
    const double command = 0.3 / gain_of(known);
    for (int k = 0; k < 60; ++k) {
      observer.send(command);
      axis.send(command);
      axis.advance(period_s);
      observer.update(axis.motion().angle_rad);
    }
    EXPECT_NEAR(observer.state_at_effect()[0], axis.motion().angle_rad, 1e-3);
    EXPECT_NEAR(observer.disturbance(), -0.2 * command, 0.01 * command);  // a fifth of the gain is missing
  }
}

}  // namespace
}  // namespace alidade
