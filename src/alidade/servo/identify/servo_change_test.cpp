#include "alidade/servo/identify/identify_causes.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "alidade/servo/identify/identify.h"
#include "alidade/testing/servo_sample.h"

namespace alidade {
namespace {

using testing::late_scene;
using testing::log_of;

/// Two axes, one after the other.
std::vector<ServoSample> changed_log(const ServoLogScene& first, const ServoLogScene& second, double at_s) {
  std::vector<ServoSample> log = log_of(first, 1);
  const std::vector<ServoSample> later = log_of(second, 1);
  for (std::size_t i = 0; i < log.size(); ++i)
    if (log[i].t_s >= at_s) log[i].angle_rad = later[i].angle_rad;
  return log;
}

/// 80 to 120 ms and 30 ms later passed for a drift of the clocks.
TEST(ServoChange, AnotherTimeConstantOrLatencyIsNamed) {
  constexpr double at_s = 10.9;
  ServoLogScene scene = late_scene(false);
  scene.duration_s = 20.0;
  AnglePlant plant = std::get<AnglePlant>(scene.axis.plant);
  plant.tau_s = 0.08;
  scene.axis.plant = plant;
  for (const bool is_of_latency : {false, true}) {
    ServoLogScene later = scene;
    if (is_of_latency) {
      later.axis.command_delay_s += 0.03;
    } else {
      plant.tau_s = 0.12;
      later.axis.plant = plant;
    }
    const std::vector<ServoSample> log = changed_log(scene, later, at_s);
    const ServoIdentification found = identify_servo(log);
    ASSERT_TRUE(found.change);
    EXPECT_NEAR(found.change->t_s, at_s, 1.0);
    EXPECT_LT(std::abs(testing::error_in_sigma(found.change->before, scene, ServoParam::tau)), 4.0);
    EXPECT_LT(std::abs(testing::error_in_sigma(found.change->after, later, ServoParam::tau)), 4.0);
    EXPECT_LT(std::abs(testing::error_in_sigma(found.change->after, later, ServoParam::latency)), 4.0);
    const Verdict verdict = identify_verdict(log, found);
    EXPECT_EQ(verdict.state, State::care);
    const std::string named = is_of_latency ? "the latency from 8" : "the time constant from ";
    EXPECT_NE(verdict.sentence.find(named), std::string::npos) << verdict.sentence;
    EXPECT_EQ(verdict.sentence.find("clocks"), std::string::npos) << verdict.sentence;
  }
}

TEST(ServoChange, NoneOfAnAxisThatStays) {
  for (const bool is_rate_plant : {false, true}) {
    const std::vector<ServoSample> log = log_of(late_scene(is_rate_plant));
    EXPECT_FALSE(servo_change(log, identify_servo(log).fit));
  }
}

}  // namespace
}  // namespace alidade
