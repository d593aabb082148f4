#pragma once

#include <string>
#include <vector>

#include "alidade/description/field.h"

namespace alidade {

/// Where a user can hold a board: the fields of a plan's config, which has them as `min_range_m`, `max_range_m` and,
/// under its own name, the largest tilt.
[[nodiscard]] FieldList board_reach_fields(double& min_range_m, double& max_range_m, const std::string& tilt_name,
                                           double& max_tilt_deg);
/// "min_range_m must be below max_range_m", or empty.
void add_reach_fault(double min_range_m, double max_range_m, std::vector<std::string>& faults);

}  // namespace alidade
