#pragma once

#include <filesystem>
#include <vector>

#include "alidade/rangefinder/edges.h"

namespace alidade {

/// Reads `pan,tilt,range_m` (rad, m), a row a reading of a rangefinder that turns with its head. Throws InputError: a
/// missing column, angles beyond 2π (degrees), a range that is not above zero or beyond 1 km, no rows.
[[nodiscard]] std::vector<ScanRow> read_scan(const std::filesystem::path& file);

}  // namespace alidade
