#pragma once

#include <filesystem>
#include <vector>

#include "alidade/public.h"
#include "alidade/rangefinder/edges.h"

namespace alidade {
class Csv;

ALIDADE_PUBLIC_BEGIN

/// Reads `pan,tilt,range_m` (rad, m), one row per reading of a rangefinder that rotates with its head. Throws
/// InputError: a missing column, angles beyond 2π (degrees), a range that is not positive or beyond 1 km, no rows.
[[nodiscard]] std::vector<ScanRow> read_scan(const std::filesystem::path& file);
/// The same for a table that has already been read.
[[nodiscard]] std::vector<ScanRow> read_scan(const Csv& csv);

ALIDADE_PUBLIC_END
}  // namespace alidade
