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

/// Reads `t_s,command,angle_rad` (or `angle_deg`): the command applied from that time on, and the encoder's reading.
/// With `command_t_s` the command applies from that time on, which must not precede that of the row before, nor follow
/// t_s. Throws InputError for a missing column, both angles, times that do not increase, or no rows.
[[nodiscard]] ServoLogFile read_servo_log(const std::filesystem::path& file, bool skip_bad = false);
[[nodiscard]] std::string servo_log_csv(std::span<const ServoSample> samples);

/// Text of servo.yaml: the plant as a scenario of `alidade servo` reads it, with its σ.
[[nodiscard]] std::string servo_plant_text(const ServoFit& fit);

ALIDADE_PUBLIC_END
}  // namespace alidade
