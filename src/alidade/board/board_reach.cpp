#include "alidade/board/board_reach.h"

#include <algorithm>

namespace alidade {

FieldList board_reach_fields(double& min_range_m, double& max_range_m, const std::string& tilt_name,
                             double& max_tilt_deg) {
  constexpr Limits positive{.min = 0.0, .is_above_min = true};
  std::string tilt_option = "--" + tilt_name;
  std::ranges::replace(tilt_option, '_', '-');
  return {{.name = "min_range_m",
           .value = &min_range_m,
           .help = "Shortest distance of the board [m]",
           .limits = positive,
           .option = "--min-range-m"},
          {.name = "max_range_m",
           .value = &max_range_m,
           .help = "Largest distance of the board [m]",
           .limits = positive,
           .option = "--max-range-m"},
          {.name = tilt_name,
           .value = &max_tilt_deg,
           .help = "Largest tilt of the board [deg]",
           .limits = {0.0, 80.0},
           .option = tilt_option}};
}

void add_reach_fault(double min_range_m, double max_range_m, std::vector<std::string>& faults) {
  if (!(min_range_m < max_range_m)) faults.emplace_back("min_range_m must be below max_range_m");
}

}  // namespace alidade
