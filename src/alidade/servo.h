#pragma once

#include <cstdint>

#include "alidade/estimation/config_error.h"
#include "alidade/estimation/progress.h"
#include "alidade/loop/servo_study.h"
#include "alidade/public.h"

/// The closed loop of a moving target, pan-tilt heads and their controllers, simulated and compared: the whole job, as
/// `alidade servo` does it.
namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Every controller of the scenario over the same seeds, from `first_seed` on. `watch` is called with the rows of
/// each controller's first trial. Throws ConfigError for an invalid scenario, Interrupted where `progress` returns
/// false.
[[nodiscard]] ServoResult servo(const ServoScenario& scenario = {}, std::uint64_t first_seed = 1,
                                const Progress& progress = {}, const ServoWatch& watch = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
