#pragma once

#include <filesystem>

#include "alidade/calibrate/photo_plan.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Reads what later commands need from the folder of a calibration (or its result.json). Throws InputError if it is not
/// a calibration, was refused, or lacks files.
[[nodiscard]] CalibratedNow read_calibration(const std::filesystem::path& result);

ALIDADE_PUBLIC_END
}  // namespace alidade
