#pragma once

#include <vector>

#include "alidade/estimation/config_error.h"
#include "alidade/public.h"
#include "alidade/servo/identification.h"

/// How one axis of a pan-tilt head follows its command: the whole job, as `alidade identify` does it.
namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// From a log of commands and angles, in order of time. Throws ConfigError for a log that cannot be: times that do not
/// ascend, numbers that are not finite; never for what the log shows.
[[nodiscard]] Identification identify(std::vector<ServoSample> log, const IdentifyConfig& config = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
