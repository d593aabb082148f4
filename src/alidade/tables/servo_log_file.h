#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/public.h"
#include "alidade/servo/identification.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

struct ServoLogFile {
  std::vector<ServoSample> samples;
  std::vector<SkippedInput> skipped;
};

/// Reads `t_s,command,angle_rad` (or `angle_deg`): what is commanded from that time on, and what the encoder reads;
/// with `command_t_s` the command counts from that time on, which is not before the row before it and not after t_s.
/// Throws InputError: no such column, both angles, times that do not run forward, no rows.
[[nodiscard]] ServoLogFile read_servo_log(const std::filesystem::path& file, bool skip_bad = false);
[[nodiscard]] std::string servo_log_csv(std::span<const ServoSample> samples);

/// Text of servo.yaml: the plant as a scenario of `alidade servo` takes it, its σ beside it.
[[nodiscard]] std::string servo_plant_text(const ServoFit& fit);

ALIDADE_PUBLIC_END
}  // namespace alidade
