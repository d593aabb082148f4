#pragma once

#include "alidade/reproduce/paper_report.h"

namespace alidade::reproduce {

/// The planes of Table 1: signs, distances, what they can determine.
[[nodiscard]] Experiment wang_table_1();
/// Table 2: three algorithms, values and times.
[[nodiscard]] Experiment wang_table_2(const ReproduceConfig& config);
/// Figures 6 to 9: errors against the number of poses.
[[nodiscard]] Experiment wang_poses(const ReproduceConfig& config);

}  // namespace alidade::reproduce
