#pragma once

#include <vector>

#include "alidade/estimation/config_error.h"
#include "alidade/public.h"
#include "alidade/servo/identification.h"

/// Identification of the dynamics of one axis of a pan-tilt head: the whole job, as `alidade identify` does it.
namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// From a log of commands and angles in chronological order. Throws ConfigError for an impossible log: times that do
/// not ascend, numbers that are not finite; never because of what the log shows.
[[nodiscard]] Identification identify(std::vector<ServoSample> log, const IdentifyConfig& config = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
