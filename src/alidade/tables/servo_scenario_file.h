#pragma once

#include <filesystem>
#include <string>

#include "alidade/loop/servo_study.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

struct ServoScenarioFile {
  ServoScenario scenario;
  std::filesystem::path rig;            ///< As the scenario names it, from its own folder; empty: the preset's.
  std::vector<std::string> rig_doubts;  ///< Of a Rig.
  std::filesystem::path track;          ///< The target's path, if it was recorded; likewise.
};

/// Reads scenario.yaml; what is omitted is the preset. Throws InputError: a key that is unknown or no number, a value
/// that no servo can have.
[[nodiscard]] ServoScenarioFile read_servo_scenario(const std::filesystem::path& file);

/// A target's path that was recorded: t_s,x_m,y_m,z_m, two rows or more. Throws InputError.
[[nodiscard]] TargetPath read_recorded_path(const std::filesystem::path& file);

/// Every key with the preset's value: a scenario to begin from.
[[nodiscard]] std::string servo_scenario_text();

ALIDADE_PUBLIC_END
}  // namespace alidade
