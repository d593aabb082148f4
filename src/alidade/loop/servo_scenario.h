#pragma once

#include <optional>
#include <string>
#include <vector>

#include "alidade/description/field.h"
#include "alidade/loop/servo_loop.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

inline constexpr int max_command_delay_periods = 32;  ///< A DelayedAxis has room for as many commands on their way.

/// Factors on gain and time constant, evenly from low to high.
struct RobustnessConfig {
  double gain_low = 0.8, gain_high = 1.2;
  double tau_low = 0.7, tau_high = 1.3;
  int points = 5;  ///< Of each.
};

/// What `alidade servo` reads: a world, and which controllers are to be compared in it. The defaults are the preset of
/// docs/maths/servo.md: plant, gains, rig and target of Xiahou, Chen & Wu, 2015.
struct ServoScenario {
  ServoScene scene = xiahou_servo_scene();
  ServoConfig config;
  std::vector<ControllerKind> controllers{controller_kinds.begin(), controller_kinds.end()};
  int num_seeds = 8;
  double specification_px = 10.0;  ///< Required RMS: lines in figures, and the verdict's.
  std::optional<RobustnessConfig> robustness = RobustnessConfig{};
};

/// The numbers of a scenario by the names of scenario.yaml, in units of the library (rad): their limits.
[[nodiscard]] FieldList fields_of(ServoScenario& scenario);

/// Throws ConfigError with every fault of a scenario.
void require_sense(ServoScenario scenario);

ALIDADE_PUBLIC_END
}  // namespace alidade
