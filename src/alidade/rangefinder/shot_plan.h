#pragma once

#include "alidade/description/field.h"
#include "alidade/estimation/config_error.h"
#include "alidade/estimation/counts.h"
#include "alidade/estimation/verdict.h"
#include "alidade/public.h"
#include "alidade/rangefinder/next_shot.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Where a board can be held, and how many shots are wanted.
struct ShotConfig {
  int shots = 3;
  double min_range_m = 0.5, max_range_m = 4.0;
  double max_tilt_deg = 45.0;
};

[[nodiscard]] FieldList fields_of(ShotConfig& config);

/// The shots to take next, in order.
struct ShotPlan {
  BeamNow now;
  std::vector<NextShot> shots;
  std::vector<Assumption> assumed;  ///< What the next shots are assumed to lack too: spots or a board.
  Counts counts;
  Verdict verdict;
};

/// The shots that lower the uncertainty of the beam most, chosen greedily. Throws ConfigError for an invalid config or
/// beam.
[[nodiscard]] ShotPlan plan_shots(const BeamNow& now, const ShotConfig& config = {}, const Progress& progress = {});

/// The inputs of plan_shots() from a calibration; without a board in `config`, a 9×6 board with 40 mm squares.
[[nodiscard]] BeamNow beam_now(const RangefinderReport& report, const RangefinderConfig& config);

ALIDADE_PUBLIC_END
}  // namespace alidade
