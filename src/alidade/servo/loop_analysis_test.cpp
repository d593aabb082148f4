#include "alidade/servo/loop_analysis.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "alidade/files/files.h"
#include "alidade/geometry/degree.h"
#include "alidade/servo/axis/axis_model.h"
#include "alidade/servo/axis/axis_settling.h"
#include "alidade/testing/reference_case.h"

namespace alidade {
namespace {

constexpr double loop_period_s = 0.05;

/// The loop of the paper with so many error units per unit of the plant's output. A radian is that many.
LoopAnalysis loop(double K, const ServoPlant& plant, int delay_samples = 0) {
  return analysed(plant, {2.0 * K, 10.0 * K, ErrorUnit::rad}, loop_period_s, delay_samples);
}
const ServoPlant angle_plant = AnglePlant{0.0567, AngleUnit::rad, 0.1};
const ServoPlant velocity_plant = RatePlant{0.0567, AngleUnit::rad, 0.1};

// Xiahou, Chen & Wu, 2015: 0.0567 / (0.1 s + 1) with 2 + 10/s; roots and margins worked out independently, to the
// digits printed.
TEST(LoopAnalysis, PaperLoopsInEachReadingOfTheUnit) {
  const LoopAnalysis unit = loop(1.0, angle_plant), deg = loop(5.8964, angle_plant), rad = loop(337.84, angle_plant);
  EXPECT_NEAR(unit.continuous.poles[0].real(), -10.599, 5e-4);
  EXPECT_NEAR(unit.continuous.poles[1].real(), -0.535, 5e-4);
  EXPECT_NEAR(unit.continuous.bandwidth_rad_s, 0.54, 5e-3);
  EXPECT_NEAR(unit.continuous.phase_margin_deg, 93.2, 0.05);
  EXPECT_NEAR(deg.continuous.poles[0].real(), -14.358, 5e-4);
  EXPECT_NEAR(deg.continuous.poles[1].real(), -2.329, 1e-3);  // of a loop gain that was rounded to 5.896
  EXPECT_NEAR(deg.continuous.bandwidth_rad_s, 2.924, 5e-3);
  EXPECT_NEAR(deg.continuous.phase_margin_deg, 106.8, 0.05);
  EXPECT_NEAR(deg.sampled_radius, 0.8766, 5e-5);
  EXPECT_NEAR(loop(5.8964, angle_plant, 2).sampled_radius, 0.850, 5e-4);
  EXPECT_NEAR(rad.continuous.poles[0].real(), -388.18, 5e-3);
  EXPECT_NEAR(rad.sampled_radius, 14.22, 5e-3);
  EXPECT_TRUE(deg.is_stable());
  EXPECT_FALSE(rad.is_stable());
}

TEST(LoopAnalysis, VelocityPlants) {
  EXPECT_NEAR(loop(1.0, velocity_plant).continuous.phase_margin_deg, 4.3, 0.05);
  EXPECT_NEAR(loop(5.8964, velocity_plant).continuous.phase_margin_deg, 9.9, 0.05);
  EXPECT_NEAR(loop(337.84, velocity_plant).continuous.phase_margin_deg, 13.2, 0.05);
  EXPECT_NEAR(loop(5.8964, velocity_plant, 1).sampled_radius, 1.0004, 5e-5);
  EXPECT_NEAR(loop(337.84, velocity_plant).sampled_radius, 1.0845, 5e-5);
}

TEST(LoopAnalysis, AgreesWithTheReferenceCase) {
  const auto reference = nlohmann::json::parse(read_file(testing::reference_case("c5_servo_lti.json")));
  const double tolerance = reference["tol_rel"];
  int num_checked = 0;
  const auto expect = [&](double value, const nlohmann::json& expected, const char* name, double digits) {
    if (!expected.contains(name)) return;
    const double wanted = expected[name];
    EXPECT_NEAR(value, wanted, std::max(tolerance * std::abs(wanted), digits)) << name;
    ++num_checked;
  };
  for (const auto& reading : reference["cases"]) {
    const LoopAnalysis analysis = loop(reading["K_px_per_unit"], angle_plant);
    for (std::size_t i = 0; i < 2; ++i) {
      const double pole = reading["poles"][i];
      EXPECT_NEAR(analysis.continuous.poles[i].real(), pole, tolerance * std::abs(pole));
    }
    expect(analysis.continuous.bandwidth_rad_s, reading, "bw_rad_s", 0.0);
    expect(analysis.continuous.phase_margin_deg, reading, "PM_deg", 0.0);
    expect(analysis.sampled_radius, reading, "discrete_radius_Ts05", 0.0);
  }
  for (const auto& reading : reference["velocity_plant"]) {
    const double K = reading["K"];
    expect(loop(K, velocity_plant).continuous.phase_margin_deg, reading, "PM_deg", 0.05);  // printed to a tenth
    expect(loop(K, velocity_plant, 1).sampled_radius, reading, "spec_radius_delay1", 0.0);
    expect(loop(K, velocity_plant, 0).sampled_radius, reading, "spec_radius_delay0", 0.0);
  }
  EXPECT_EQ(num_checked, 11);
}

/// The radius is the rate at which the sampled loop itself grows or dies.
TEST(LoopAnalysis, RadiusIsTheGrowthOfTheSimulatedLoop) {
  for (const ServoPlant& plant : {angle_plant, velocity_plant}) {
    for (const int delay : {0, 1, 3}) {
      const double K = 40.0;
      const AxisModel model = sampled(plant, loop_period_s);
      Eigen::Vector2d state(1.0, 0.0);
      std::vector<double> errors(static_cast<std::size_t>(delay), 0.0);
      double integral = 0.0, size_at_200 = 0.0, size_at_400 = 0.0;
      for (int k = 0; k < 400; ++k) {
        errors.push_back(-K * state[0]);
        const double error = errors[static_cast<std::size_t>(k)];
        state = model.A * state + model.B * (2.0 * error + 10.0 * integral);
        integral += loop_period_s * error;
        // The size over 20 samples, so that an oscillation's phase does not matter.
        if (k >= 180 && k < 200) size_at_200 = std::max(size_at_200, std::abs(state[0]));
        if (k >= 380) size_at_400 = std::max(size_at_400, std::abs(state[0]));
      }
      EXPECT_NEAR(std::pow(size_at_400 / size_at_200, 1.0 / 200.0), loop(K, plant, delay).sampled_radius,
                  5e-3);  // the windows' maxima meet the peaks within a factor of 2: 2^(1/200)
    }
  }
}

/// The paper's plant with images late: margins worked out independently from (1−a)/(z−a) (kp + ki T/(z−1)) z^−n.
TEST(LoopAnalysis, MarginsAreOfTheSampledLoopWithItsDelays) {
  struct Known {
    double kp, ki;
    int late;
    double margin_deg, crossover_rad_s, bandwidth_rad_s;
  };
  constexpr double per_px = 337.84;
  const ServoPlant plant = AnglePlant{0.0567, AngleUnit::deg, 0.1};
  for (const Known& known :
       {Known{2.0, 10.0, 0, 96.9738, 3.74028, 3.25834}, Known{2.0, 10.0, 2, 75.5436, 3.74028, 11.2293},
        Known{2.0, 10.0, 6, 32.6831, 3.74028, 8.33473}, Known{6.0, 40.0, 1, 25.4851, 16.1175, 33.2476},
        Known{6.0, 40.0, 2, -20.6880, 16.1175, 23.0802}}) {
    const LoopAnalysis loop =
        analysed(plant, {per_px * known.kp, per_px * known.ki, ErrorUnit::rad}, loop_period_s, known.late);
    EXPECT_NEAR(loop.phase_margin_deg, known.margin_deg, 1e-3);
    EXPECT_NEAR(loop.crossover_rad_s, known.crossover_rad_s, 1e-4);
    EXPECT_NEAR(loop.bandwidth_rad_s, known.bandwidth_rad_s, 1e-3);
    EXPECT_EQ(loop.phase_margin_deg > 0.0, loop.is_stable());
    ServoAxis axis;  // the same, late on the way to the axis
    axis.plant = plant;
    axis.command_delay_s = known.late * loop_period_s;
    const LoopAnalysis late = analysed(axis, {per_px * known.kp, per_px * known.ki, ErrorUnit::rad}, loop_period_s);
    EXPECT_NEAR(late.phase_margin_deg, loop.phase_margin_deg, 1e-6);
    EXPECT_NEAR(late.sampled_radius, loop.sampled_radius, 1e-9);
  }
}

ServoAxis lagging_axis(const ServoPlant& plant, double second_tau_s, double command_delay_s) {
  ServoAxis axis;
  axis.plant = plant;
  axis.second_tau_s = second_tau_s;
  axis.command_delay_s = command_delay_s;
  return axis;
}

/// A loop endures as many periods more as its phase margin has at the crossover, and no more.
TEST(LoopAnalysis, ThePhaseMarginIsTheDelayThatIsLeft) {
  int num_tried = 0;
  for (const ServoPlant& plant : {angle_plant, velocity_plant}) {
    for (const double second_tau_s : {0.0, 0.06}) {
      for (const double command_delay_s : {0.0, 0.02, 0.07}) {
        for (const double K : {2.0, 6.0, 12.0}) {
          const ServoAxis axis = lagging_axis(plant, second_tau_s, command_delay_s);
          const bool is_rate = std::holds_alternative<RatePlant>(plant);
          const PiGains gains{2.0 * K, is_rate ? 0.5 * K : 10.0 * K, ErrorUnit::rad};
          const LoopAnalysis loop = analysed(axis, gains, loop_period_s);
          ASSERT_GT(loop.crossover_rad_s, 0.0);
          ASSERT_EQ(loop.phase_margin_deg > 0.0, loop.is_stable()) << K << " " << command_delay_s;
          if (!loop.is_stable()) continue;
          const double left = loop.phase_margin_deg * degree / (loop.crossover_rad_s * loop_period_s);
          const int whole = static_cast<int>(left);
          EXPECT_TRUE(analysed(axis, gains, loop_period_s, whole).is_stable()) << left;
          EXPECT_FALSE(analysed(axis, gains, loop_period_s, whole + 1).is_stable()) << left;
          ++num_tried;
        }
      }
    }
  }
  EXPECT_GT(num_tried, 20);
}

/// Parts of a period and second lags, against the axis that simulates them.
TEST(LoopAnalysis, RadiusOfALaggingLateAxisIsThatOfTheSimulatedOne) {
  int num_tried = 0;
  for (const ServoPlant& plant : {ServoPlant(AnglePlant{}), ServoPlant(RatePlant{})}) {
    for (const double second_tau_s : {0.0, 0.02, 0.1}) {
      for (const double command_delay_s : {0.0, 0.015, 0.08}) {
        const ServoAxis axis = lagging_axis(plant, second_tau_s, command_delay_s);
        ServoConfig config;
        config.controller = ControllerKind::pi;
        if (std::holds_alternative<RatePlant>(plant)) config.pi = {4.0, 4.0, ErrorUnit::rad};
        constexpr double focal_px = 337.84;
        const double radius = analysed(axis, config.pi.per_rad(focal_px), loop_period_s, 2).sampled_radius;
        const double simulated = settling_per_period(config, axis, axis, focal_px, 2.0 * loop_period_s);
        EXPECT_NEAR(radius, simulated, 0.02) << second_tau_s << " " << command_delay_s;  // a window meets a phase
        ++num_tried;
      }
    }
  }
  EXPECT_EQ(num_tried, 18);
}

TEST(LqrGain, IsStableAndBest) {
  for (const ServoPlant& plant : {ServoPlant(AnglePlant{}), ServoPlant(RatePlant{})}) {
    const AxisModel model = sampled(plant, loop_period_s);
    const Eigen::RowVector2d K = lqr_gain(model, 2.0);
    const auto cost = [&](const Eigen::RowVector2d& gain) {
      Eigen::Vector2d state(1.0, 0.0);
      double sum = 0.0;
      for (int k = 0; k < 2000; ++k) {
        const double command = -gain.dot(state), effort = effect_of_command(model) * command;
        sum += state[0] * state[0] + 2.0 * effort * effort;
        state = (model.A * state + model.B * command).eval();
      }
      return sum;
    };
    const double best = cost(K);
    EXPECT_TRUE(std::isfinite(best));
    for (const double factor : {0.9, 1.1}) EXPECT_GT(cost(factor * K), best);
  }
}

}  // namespace
}  // namespace alidade
