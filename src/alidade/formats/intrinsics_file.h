#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "alidade/observe/intrinsics_estimate.h"
#include "alidade/pantilt/intrinsics_history.h"

namespace alidade {

/// Text of intrinsics.csv: t_s,fx,fy,cx,cy,sigma_fx,sigma_fy,sigma_cx,sigma_cy,nis,event. One row per row of the log,
/// with empty cells until there is an estimate, and events by `event_name`; σ and NIS are empty if the method has none.
/// Throws std::logic_error if the number of times differs from that of the estimates.
[[nodiscard]] std::string intrinsics_csv(std::span<const double> t_s, std::span<const IntrinsicsEstimate> estimates);

/// Reads such a file: t_s,fx,fy,cx,cy,sigma_fx,sigma_fy,sigma_cx,sigma_cy; other columns may follow, and rows without
/// an estimate are ignored. Throws InputError for a missing column, no estimates, times that do not increase, a focal
/// length that is not positive, or an estimate without σ.
[[nodiscard]] IntrinsicsHistory read_intrinsics_history(const std::filesystem::path& file);

}  // namespace alidade
