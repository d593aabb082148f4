#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "alidade/simulate/servo.h"

namespace alidade {
namespace {

/// More than 32 rows of latency, the room that a DelayedAxis has for commands: the oldest acted at once, 50 ms early.
TEST(ServoLog, ALatencyOfManyRowsIsKept) {
  ServoLogScene scene;
  AnglePlant plant{0.001, AngleUnit::rad, 0.1};
  scene.axis.plant = plant;
  scene.axis.command_delay_s = 0.083;
  scene.rate_hz = 1000.0;
  scene.steps = {1.0};
  scene.sigma_rad = 0.0;
  for (const ServoLogRow& row : simulate_servo_log(scene, 1)) {
    const double since_s = std::max(0.0, row.t_s - scene.step_at_s - scene.axis.command_delay_s);
    EXPECT_NEAR(row.angle_rad, -0.2 * std::expm1(-since_s / plant.tau_s), 1e-9) << row.t_s;
  }
}

}  // namespace
}  // namespace alidade
