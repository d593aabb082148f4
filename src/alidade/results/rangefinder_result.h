#pragma once

#include <filesystem>

#include "alidade/public.h"
#include "alidade/rangefinder/next_shot.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Reads what `plan rangefinder` needs from the folder of a calibrated rangefinder (or its result.json). Throws
/// InputError if it is not such a result, or was refused without a beam.
[[nodiscard]] BeamNow read_rangefinder(const std::filesystem::path& result);

ALIDADE_PUBLIC_END
}  // namespace alidade
