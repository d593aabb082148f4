#pragma once

#include <optional>
#include <string>
#include <vector>

#include "alidade/description/field.h"
#include "alidade/loop/servo_loop.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

inline constexpr int max_command_delay_periods = 32;  ///< Capacity of a DelayedAxis.

/// Factors on gain and time constant, evenly spaced from low to high.
struct RobustnessConfig {
  double gain_low = 0.8, gain_high = 1.2;
  double tau_low = 0.7, tau_high = 1.3;
  int points = 5;  ///< Per factor.
};

/// The input of `alidade servo`: a scene, and the controllers to compare in it. The defaults are the preset of
/// docs/maths/servo.md: plant, gains, rig and target of Xiahou, Chen & Wu, 2015.
struct ServoScenario {
  ServoScene scene = xiahou_servo_scene();
  ServoConfig config;
  std::vector<ControllerKind> controllers{controller_kinds.begin(), controller_kinds.end()};
  int num_seeds = 8;
  double specification_px = 10.0;  ///< Required RMS: drawn as a line in figures, and used by the verdict.
  std::optional<RobustnessConfig> robustness = RobustnessConfig{};
};

/// The numbers of a scenario, named as in scenario.yaml, in the library's units (rad), with their limits.
[[nodiscard]] FieldList fields_of(ServoScenario& scenario);

/// Throws ConfigError listing every fault of a scenario.
void require_sense(ServoScenario scenario);

ALIDADE_PUBLIC_END
}  // namespace alidade
