#pragma once

#include <cstdint>

#include "alidade/estimation/config_error.h"
#include "alidade/estimation/progress.h"
#include "alidade/loop/servo_study.h"
#include "alidade/public.h"

/// Simulation and comparison of the closed loop of a moving target, pan-tilt heads and their controllers: the whole
/// job, as `alidade servo` does it.
namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Runs every controller of the scenario with the same seeds, starting from `first_seed`. `watch` is called with the
/// rows of each controller's first trial. Throws ConfigError for an invalid scenario, Interrupted where `progress`
/// returns false.
[[nodiscard]] ServoResult servo(const ServoScenario& scenario = {}, std::uint64_t first_seed = 1,
                                const Progress& progress = {}, const ServoWatch& watch = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
