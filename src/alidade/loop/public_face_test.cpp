#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "alidade/results/servo_outcome.h"
#include "alidade/servo.h"

// The whole job through its public header: the same figures as from the parts, and an answer to every misuse.

namespace alidade {
namespace {

ServoScenario brief() {
  ServoScenario scenario;
  scenario.scene.duration_s = 4.0;
  scenario.num_seeds = 2;
  scenario.controllers = {ControllerKind::pi, ControllerKind::feedforward};
  scenario.robustness.reset();
  return scenario;
}

TEST(ServoFace, IsTheWholeJob) {
  const ServoScenario scenario = brief();
  std::size_t num_shown = 0;
  const ServoResult result = servo(scenario, 3, {}, [&](ControllerKind, const ServoRow&) { ++num_shown; });
  const ServoStudy part = study_servo(scenario, 3);
  ASSERT_EQ(result.comparison.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) EXPECT_EQ(result.comparison[i].figures.rms_px, part.comparison[i].figures.rms_px);
  EXPECT_EQ(result.status, ServoStudy::Status::compared);
  EXPECT_EQ(result.verdict.sentence, servo_verdict(scenario, part).sentence);
  EXPECT_EQ(result.counts.given, 4u);
  EXPECT_FALSE(result.assumed.empty());
  EXPECT_EQ(num_shown, result.comparison[0].shown.rows.size() + result.comparison[1].shown.rows.size());
  const JobOutcome outcome = outcome_of(result);
  ASSERT_EQ(outcome.files.size(), 1u);
  EXPECT_EQ(outcome.files[0].name, "servo.csv");
}

TEST(ServoFace, AnUnstableLoopIsAVerdict) {
  ServoScenario scenario = brief();
  scenario.config.pi.kp = 100.0;
  const ServoResult result = servo(scenario);
  EXPECT_EQ(result.status, ServoStudy::Status::unstable);
  EXPECT_EQ(result.verdict.exit_code, ExitCode::undetermined);
  EXPECT_TRUE(outcome_of(result).files.empty());
}

std::string fault_of(const ServoScenario& scenario) {
  try {
    require_sense(scenario);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

TEST(ServoFace, AnswersEveryHostileNumber) {
  const double inf = std::numeric_limits<double>::infinity();
  for (const bool is_rate_plant : {false, true}) {
    ServoScenario plain;
    if (is_rate_plant) plain.scene.axes[0].plant = plain.scene.axes[1].plant = RatePlant{};
    EXPECT_EQ(fault_of(plain), "");
    const std::size_t num_fields = fields_of(plain).size();
    EXPECT_GT(num_fields, 40u);
    for (std::size_t k = 0; k < num_fields; ++k) {
      for (const double bad : {std::nan(""), inf, -inf, -1e300, 1e300}) {
        ServoScenario scenario = plain;
        const Field field = fields_of(scenario)[k];
        double* const* number = std::get_if<double*>(&field.value);
        const bool may_be_none = field.name.ends_with("max_rate_rad_s") ||
                                 (!is_rate_plant && field.name.ends_with("max_acceleration_rad_s2"));
        if (number == nullptr || (bad == inf && may_be_none)) continue;
        **number = bad;
        EXPECT_THAT(fault_of(scenario), ::testing::HasSubstr(field.name)) << bad;
      }
    }
  }
}

TEST(ServoFace, AnswersWhatDoesNotFitTogether) {
  const auto refuses = [](const auto& spoil) {
    ServoScenario scenario;
    spoil(scenario);
    EXPECT_NE(fault_of(scenario), "");
    EXPECT_THROW((void)servo(scenario), ConfigError);
  };
  refuses([](ServoScenario& of) { of.controllers.clear(); });
  refuses([](ServoScenario& of) { of.controllers = {ControllerKind::pi, ControllerKind::pi}; });
  refuses([](ServoScenario& of) { of.controllers = {static_cast<ControllerKind>(9)}; });
  refuses([](ServoScenario& of) { of.num_seeds = 0; });
  refuses([](ServoScenario& of) { of.robustness->points = -1; });
  refuses([](ServoScenario& of) { of.scene.heads.clear(); });
  refuses([](ServoScenario& of) { of.scene.heads[0].camera.width_px = 0; });
  refuses([](ServoScenario& of) { of.scene.rig_errors.factor.resize(1); });
  refuses([](ServoScenario& of) { of.scene.warm_up_s = 12.0; });
  refuses([](ServoScenario& of) { of.scene.latency_s = 10.0, of.scene.period_s = 0.01; });
  refuses([](ServoScenario& of) { of.scene.path.start_m.x() = std::nan(""); });
  refuses([](ServoScenario& of) { of.scene.path.kind = PathKind::recorded; });
  refuses([](ServoScenario& of) { of.scene.hidden_s = {{3.0, 2.0}}; });
  refuses([](ServoScenario& of) { of.scene.zoom = {.t_s = {1.0}, .factor = {}}; });
  refuses([](ServoScenario& of) { of.scene.intrinsics = static_cast<LensKnowledge>(7); });
  refuses([](ServoScenario& of) { of.scene.background_points = 0; });
  refuses([](ServoScenario& of) { of.scene.axes[1].min_rad = of.scene.axes[1].max_rad = 0.0; });
}

}  // namespace
}  // namespace alidade
