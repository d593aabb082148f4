#include "alidade/pantilt/servo_plant.h"

#include "alidade/pantilt/positioner.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "alidade/testing/random.h"

namespace alidade {
namespace {

/// dθ and dω as the plants' docstrings say them.
AxisMotion derivative(const ServoPlant& plant, const AxisMotion& motion, double command) {
  if (const auto* angle = std::get_if<AnglePlant>(&plant))
    return {(angle->gain_rad() * command - motion.angle_rad) / angle->tau_s, 0.0};
  const auto& rate = std::get<RatePlant>(plant);
  const double goal = std::clamp(rate.gain_rad() * command, -rate.max_rate_rad_s, rate.max_rate_rad_s);
  const double pull = (goal - motion.rate_rad_s) / rate.tau_s;
  return {motion.rate_rad_s, std::clamp(pull, -rate.max_acceleration_rad_s2, rate.max_acceleration_rad_s2)};
}

/// Heun's rule in steps so small that its error is below 1e-9.
AxisMotion integrated(const ServoPlant& plant, AxisMotion motion, double command, double dt_s) {
  constexpr int steps = 20000;
  const double h = dt_s / steps;
  for (int i = 0; i < steps; ++i) {
    const AxisMotion a = derivative(plant, motion, command);
    const AxisMotion b =
        derivative(plant, {motion.angle_rad + h * a.angle_rad, motion.rate_rad_s + h * a.rate_rad_s}, command);
    motion.angle_rad += 0.5 * h * (a.angle_rad + b.angle_rad);
    motion.rate_rad_s += 0.5 * h * (a.rate_rad_s + b.rate_rad_s);
  }
  return motion;
}

TEST(ServoPlant, ClosedFormIsTheIntegralOfItsEquation) {
  auto rng = testing::make_rng();
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  int num_hard = 0;
  for (int i = 0; i < 60; ++i) {
    ServoAxis axis;
    if (i % 2 == 0) {
      axis.plant = AnglePlant{0.0567, AngleUnit::deg, 0.05 + 0.05 * std::abs(unit(rng))};
    } else {
      axis.plant = RatePlant{};
    }
    const AxisMotion start{unit(rng), i % 2 == 0 ? 0.0 : 3.0 * unit(rng)};
    const double command = i % 2 == 0 ? 500.0 * unit(rng) : 5.0 * unit(rng), dt_s = 0.2 * std::abs(unit(rng));
    num_hard += i % 2 == 1 && std::abs(command - start.rate_rad_s) > 1.309 ? 1 : 0;
    const AxisMotion exact = advanced(axis, start, command, dt_s);
    const AxisMotion numeric = integrated(axis.plant, start, command, dt_s);
    EXPECT_NEAR(exact.angle_rad, numeric.angle_rad, 1e-6);  // the corner of the clamp costs Heun's rule an order
    if (i % 2 == 1) {
      EXPECT_NEAR(exact.rate_rad_s, numeric.rate_rad_s, 1e-5);
    }
  }
  EXPECT_GT(num_hard, 10);
}

/// Both lags in ten thousand steps of Heun's rule; equal ones among them.
TEST(ServoPlant, BehindASecondLagIsTheIntegralOfItsEquations) {
  for (const ServoPlant& plant :
       {ServoPlant(AnglePlant{2.0, AngleUnit::rad, 0.1}), ServoPlant(RatePlant{2.0, AngleUnit::rad, 0.1, 1e9, 1e9})}) {
    for (const double lag_s : {0.004, 0.06, 0.1, 0.1 + 1e-12, 0.3}) {
      const LaggedMotion start{{0.3, std::holds_alternative<RatePlant>(plant) ? -0.4 : 0.0}, 0.7};
      constexpr double command = -0.2, dt_s = 0.13;
      constexpr int steps = 10000;
      LaggedMotion numeric = start;
      const double h = dt_s / steps;
      const auto slope = [&](const LaggedMotion& at) {
        return LaggedMotion{derivative(plant, at.motion, at.lagged), (command - at.lagged) / lag_s};
      };
      const auto moved = [](const LaggedMotion& at, const LaggedMotion& by, double step) {
        return LaggedMotion{
            {at.motion.angle_rad + step * by.motion.angle_rad, at.motion.rate_rad_s + step * by.motion.rate_rad_s},
            at.lagged + step * by.lagged};
      };
      for (int i = 0; i < steps; ++i) {
        const LaggedMotion a = slope(numeric), b = slope(moved(numeric, a, h));
        numeric = moved(moved(numeric, a, 0.5 * h), b, 0.5 * h);
      }
      const LaggedMotion exact = advanced_behind_lag(plant, lag_s, start, command, dt_s);
      EXPECT_NEAR(exact.motion.angle_rad, numeric.motion.angle_rad, 1e-7) << lag_s;
      EXPECT_NEAR(exact.lagged, numeric.lagged, 1e-6) << lag_s;
      if (std::holds_alternative<RatePlant>(plant)) {
        EXPECT_NEAR(exact.motion.rate_rad_s, numeric.motion.rate_rad_s, 1e-6) << lag_s;
      }
    }
  }
}

TEST(ServoPlant, TwoHalvesMakeAWhole) {
  for (const ServoPlant& plant : {ServoPlant(AnglePlant{}), ServoPlant(RatePlant{})}) {
    const ServoAxis axis{plant};
    const AxisMotion start{0.1, -1.0};
    const AxisMotion whole = advanced(axis, start, 2.5, 0.13);
    const AxisMotion halves = advanced(axis, advanced(axis, start, 2.5, 0.05), 2.5, 0.08);
    EXPECT_NEAR(whole.angle_rad, halves.angle_rad, 1e-14);
    if (std::holds_alternative<RatePlant>(plant)) {
      EXPECT_NEAR(whole.rate_rad_s, halves.rate_rad_s, 1e-14);
    }
  }
}

TEST(ServoPlant, KeepsWithinWhatItCanDo) {
  ServoAxis axis{RatePlant{}};
  axis.min_rad = -0.5;
  axis.max_rad = 0.8;
  AxisMotion motion;
  for (int i = 0; i < 200; ++i) {
    const AxisMotion next = advanced(axis, motion, 100.0, 0.01);
    EXPECT_LE(next.rate_rad_s, std::get<RatePlant>(axis.plant).max_rate_rad_s + 1e-12);
    EXPECT_LE(next.rate_rad_s - motion.rate_rad_s, 0.01 * 26.18);
    EXPECT_LE(next.angle_rad, 0.8);
    motion = next;
  }
  EXPECT_EQ(motion.angle_rad, 0.8);
  EXPECT_EQ(motion.rate_rad_s, 0.0);
}

TEST(ServoPlant, AnAngleWithALimitOfItsAccelerationIsAPositioner) {
  const PositionerParams params{
      .rate_rad_s = 0.7, .acceleration_rad_s2 = 2.1, .time_constant_s = 0.06, .latency_s = 0.1};
  Positioner positioner(params, 0.0, 0.0);
  const AnglePlant plant{1.0, AngleUnit::rad, 0.06, 0.7, 2.1};
  DelayedAxis axis({.plant = plant, .command_delay_s = 0.1}, {});
  double t_s = 0.0, farthest = 0.0;
  for (const double goal : {0.5, 0.52, -0.3, -0.31, 0.0}) {
    positioner.go_to(t_s, goal);
    axis.send(goal);
    for (int i = 0; i < 9; ++i) {
      positioner.advance(t_s += 0.05);
      axis.advance(0.05);
      farthest = std::max(farthest, std::abs(positioner.output_rad() - axis.motion().angle_rad));
    }
  }
  EXPECT_LT(farthest, 2e-6);  // where a positioner rests
}

/// The equations of docs/maths/servo.md in steps of 2 µs, commands given while it moves, faster than it may, and away.
TEST(Positioner, IsTheIntegralOfItsEquations) {
  std::mt19937_64 random = testing::make_rng();
  const auto uniform = [&](double low, double high) { return std::uniform_real_distribution(low, high)(random); };
  for (int trial = 0; trial < 12; ++trial) {
    const PositionerParams p{.rate_rad_s = uniform(0.1, 1.5),
                             .acceleration_rad_s2 = uniform(0.5, 8.0),
                             .time_constant_s = uniform(0.01, 0.3),
                             .latency_s = 0.0,
                             .backlash_rad = trial % 2 == 0 ? 0.0 : 0.006};
    Positioner closed(p, 0.0, 0.0);
    constexpr double dt_s = 2e-6;
    double x = 0.0, v = 0.0, read = 0.0, t_s = 0.0, worst = 0.0;
    for (int command = 0; command < 6; ++command) {
      const double goal = uniform(-0.6, 0.6);
      closed.go_to(t_s, goal);
      const int steps = static_cast<int>(uniform(0.05, 0.7) / dt_s);
      for (int k = 1; k <= steps; ++k) {
        const double e = goal - x, left = std::abs(e), a = p.acceleration_rad_s2, tau = p.time_constant_s;
        const double curve = left <= a * tau * tau ? left / tau : std::sqrt(2.0 * a * (left - 0.5 * a * tau * tau));
        const double wanted = std::copysign(std::min(p.rate_rad_s, curve), e);
        v += std::clamp(wanted - v, -a * dt_s, a * dt_s);
        x += v * dt_s;
        read = std::clamp(read, x - 0.5 * p.backlash_rad, x + 0.5 * p.backlash_rad);
        if (k % 7000 != 0 && k != steps) continue;
        closed.advance(t_s + k * dt_s);
        worst = std::max(worst, std::abs(closed.output_rad() - read));
      }
      t_s += steps * dt_s;
    }
    EXPECT_LT(worst, 2e-5) << trial;  // a step of Euler's of 1.5 rad/s is 3e-6, and it rests 2e-6 beside its target
  }
}

/// How it is asked changes nothing.
TEST(Positioner, IsTheSameHoweverOftenItIsAsked) {
  const PositionerParams p{.backlash_rad = 0.003, .dead_band_rad = 0.001};
  Positioner seldom(p, 0.1, 0.0), often(p, 0.1, 0.0);
  double t_s = 0.0;
  for (const double goal : {0.5, -0.2, 0.4, 0.4004, 0.1}) {
    seldom.go_to(t_s, goal);
    often.go_to(t_s, goal);
    for (int i = 0; i < 1000; ++i) often.advance(t_s + 0.0009 * (i + 1));
    seldom.advance(t_s += 0.9);
    EXPECT_NEAR(seldom.output_rad(), often.output_rad(), 4e-6);
  }
}

TEST(ServoPlant, UnitsAreExplicit) {
  EXPECT_NEAR((AnglePlant{2.0, AngleUnit::deg, 0.1}).gain_rad(), 0.0349065850398866, 1e-15);
  EXPECT_EQ((AnglePlant{2.0, AngleUnit::rad, 0.1}).gain_rad(), 2.0);
  EXPECT_EQ(unit_named("deg"), AngleUnit::deg);
  EXPECT_EQ(unit_named("grad"), std::nullopt);
}

TEST(DelayedAxis, ObeysLateAndInOrder) {
  ServoAxis axis{AnglePlant{1.0, AngleUnit::rad, 0.1}};
  axis.command_delay_s = 0.07;
  DelayedAxis late(axis, {});
  axis.command_delay_s = 0.0;
  const ServoAxis prompt = axis;
  // Commands at 0, 0.05, 0.10 … act at 0.07, 0.12, 0.17 …
  AxisMotion expected;
  for (int k = 0; k < 10; ++k) {
    late.send(0.1 * (k + 1));
    late.advance(0.05);
    const double before = k < 1 ? 0.0 : k < 2 ? 0.0 : 0.1 * (k - 1), after = k < 1 ? 0.0 : 0.1 * k;
    expected = advanced(prompt, expected, before, 0.02);
    expected = advanced(prompt, expected, after, 0.03);
    EXPECT_NEAR(late.motion().angle_rad, expected.angle_rad, 1e-14) << k;
  }
}

}  // namespace
}  // namespace alidade
