#pragma once

#include <filesystem>

#include "alidade/calibrate/photo_plan.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Reads what later commands need of the folder of a calibration (or the result.json in it). Throws InputError: not a
/// calibration, a refused one, files missing.
[[nodiscard]] CalibratedNow read_calibration(const std::filesystem::path& result);

ALIDADE_PUBLIC_END
}  // namespace alidade
