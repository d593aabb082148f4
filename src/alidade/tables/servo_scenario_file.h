#pragma once

#include <filesystem>
#include <string>

#include "alidade/loop/servo_study.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

struct ServoScenarioFile {
  ServoScenario scenario;
  std::filesystem::path rig;            ///< File named in the scenario, relative to its folder; empty: the preset's.
  std::vector<std::string> rig_doubts;  ///< As in Rig::doubts.
  std::filesystem::path track;          ///< File of the target's path, if it was recorded; relative as well.
};

/// Reads scenario.yaml; omitted keys have the preset's values. Throws InputError for an unknown key, a value that is
/// not a number, or a value that no servo can have.
[[nodiscard]] ServoScenarioFile read_servo_scenario(const std::filesystem::path& file);

/// Reads a recorded path of a target: t_s,x_m,y_m,z_m, at least two rows. Throws InputError.
[[nodiscard]] TargetPath read_recorded_path(const std::filesystem::path& file);

/// Text of a scenario with every key at the preset's value, as a starting point.
[[nodiscard]] std::string servo_scenario_text();

ALIDADE_PUBLIC_END
}  // namespace alidade
