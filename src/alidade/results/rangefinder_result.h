#pragma once

#include <filesystem>

#include "alidade/public.h"
#include "alidade/rangefinder/next_shot.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// What `plan rangefinder` needs of the folder (or result.json) of a calibrated rangefinder. Throws InputError: not
/// such a result, or a refused one that leaves no beam.
[[nodiscard]] BeamNow read_rangefinder(const std::filesystem::path& result);

ALIDADE_PUBLIC_END
}  // namespace alidade
