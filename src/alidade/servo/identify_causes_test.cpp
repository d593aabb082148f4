#include "alidade/servo/identify_causes.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alidade/geometry/degree.h"
#include "alidade/simulate/servo.h"

namespace alidade {
namespace {

std::vector<ServoSample> rows_of(const ServoLogScene& scene, std::uint64_t seed) {
  std::vector<ServoSample> log;
  for (const ServoLogRow& row : simulate_servo_log(scene, seed)) log.push_back({row.t_s, row.command, row.angle_rad});
  return log;
}

ServoLogScene late_scene(bool is_rate_plant) {
  ServoLogScene scene;
  if (is_rate_plant) {
    RatePlant plant{0.005, AngleUnit::rad, 0.08};
    plant.max_rate_rad_s = plant.max_acceleration_rad_s2 = 1e9;
    scene.axis.plant = plant;
  }
  scene.axis.command_delay_s = 0.083;
  return scene;
}

TEST(ServoCauses, SteppedThroughIsTheClosedForm) {
  for (const bool is_rate_plant : {false, true}) {
    const std::vector<ServoSample> log = rows_of(late_scene(is_rate_plant), 1);
    const ServoFit fit = identify_servo(log).fit;
    const Eigen::VectorXd exact = servo_response(log, fit.kind, fit.params).angle_rad;
    const double range = exact.maxCoeff() - exact.minCoeff();
    EXPECT_LT((flawed_response(log, fit, {}) - exact).cwiseAbs().maxCoeff(), 0.01 * range);
  }
}

TEST(ServoCauses, CleanLogsAreGood) {
  int good = 0, runs = 0;
  for (const bool is_rate_plant : {false, true}) {
    for (const bool is_chirp : {false, true}) {
      for (std::uint64_t seed = 1; seed <= 20; ++seed, ++runs) {
        ServoLogScene scene = late_scene(is_rate_plant);
        scene.is_chirp = is_chirp;
        const std::vector<ServoSample> log = rows_of(scene, seed);
        const Verdict verdict = identify_verdict(log, identify_servo(log));
        good += verdict.state == State::good ? 1 : 0;
      }
    }
  }
  EXPECT_GE(good, 76) << "of " << runs;
}

/// What the axis reads where commands smaller than a band do nothing, or its gear has play.
std::vector<ServoSample> flawed_log(double dead_band, double backlash_rad, bool is_one_step, std::uint64_t seed) {
  ServoLogScene scene = late_scene(false);
  if (is_one_step) scene.steps = {1.0};
  ServoFit truth;
  truth.params << gain_of(scene.axis.plant), tau_of(scene.axis.plant), 0.083, 0.0, 0.0;
  std::vector<ServoSample> log = rows_of(scene, seed);
  ServoFlaws flaws;
  flaws.dead_band = dead_band;
  flaws.backlash_rad = backlash_rad;
  const Eigen::VectorXd angles = flawed_response(log, truth, flaws);
  Draws draws(seed);
  for (std::size_t i = 0; i < log.size(); ++i)
    log[i].angle_rad = angles[static_cast<Eigen::Index>(i)] + scene.sigma_rad * draws.normal();
  return log;
}

TEST(ServoCauses, FlawsAreNamed) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const auto first_of = [](const std::vector<ServoSample>& log) {
      const ServoIdentification identified = identify_servo(log);
      EXPECT_EQ(identify_verdict(log, identified).state, State::care);
      const std::vector<ServoCause> causes = servo_causes(log, identified);
      return causes.empty() ? std::string("none") : causes.front().name;
    };
    EXPECT_EQ(first_of(flawed_log(10.0, 0.0, false, seed)), "a dead band");
    EXPECT_EQ(first_of(flawed_log(0.0, 0.5 * degree, false, seed)), "backlash");
    ServoLogScene limited = late_scene(true);
    RatePlant plant{0.005, AngleUnit::rad, 0.08};
    plant.max_rate_rad_s = 0.6;  // of 1 that the largest command asks for
    plant.max_acceleration_rad_s2 = 1e9;
    limited.axis.plant = plant;
    EXPECT_EQ(first_of(rows_of(limited, seed)), "a limit of its rate");
  }
}

/// One step of one size cannot show them: it is said.
TEST(ServoCauses, OneStepIsNotGood) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const std::vector<ServoSample> log = flawed_log(10.0, 0.0, true, seed);
    const Verdict verdict = identify_verdict(log, identify_servo(log));
    EXPECT_EQ(verdict.state, State::care);
    EXPECT_NE(verdict.to_add.find("several sizes"), std::string::npos);
  }
}

TEST(ServoCauses, UnitsAndRoundingAreNamed) {
  const auto sentence_of = [](const std::vector<ServoSample>& log) {
    return identify_verdict(log, identify_servo(log)).sentence;
  };
  std::vector<ServoSample> log = rows_of(late_scene(false), 1);
  for (ServoSample& row : log) row.angle_rad /= degree;
  EXPECT_NE(sentence_of(log).find("are these degrees"), std::string::npos);
  log = rows_of(late_scene(false), 1);
  for (ServoSample& row : log) row.t_s *= 1000.0;
  EXPECT_NE(sentence_of(log).find("are these milliseconds"), std::string::npos);
  ServoLogScene rounded = late_scene(false);
  rounded.sigma_rad = 1e-5;
  rounded.encoder_step_rad = 0.1 * degree;
  const std::vector<ServoSample> coarse = rows_of(rounded, 1);
  EXPECT_NEAR(encoder_step_rad(coarse), 0.1 * degree, 1e-9);
  EXPECT_EQ(identify_verdict(coarse, identify_servo(coarse)).state, State::care);
}

}  // namespace
}  // namespace alidade
