#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "alidade/observe/intrinsics_estimate.h"
#include "alidade/pantilt/intrinsics_history.h"

namespace alidade {

/// Text of intrinsics.csv: t_s,fx,fy,cx,cy,sigma_fx,sigma_fy,sigma_cx,sigma_cy,nis,event. A row per row of the log,
/// empty until there is an estimate, events by `event_name`; σ and NIS are empty where the method has none. Throws
/// std::logic_error where the times are not as many as the estimates.
[[nodiscard]] std::string intrinsics_csv(std::span<const double> t_s, std::span<const IntrinsicsEstimate> estimates);

/// Reads such a file: t_s,fx,fy,cx,cy,sigma_fx,sigma_fy,sigma_cx,sigma_cy; other columns may follow, rows without an
/// estimate are passed over. Throws InputError: a column or all estimates missing, times that do not ascend, a focal
/// length that is not above zero, an estimate without σ.
[[nodiscard]] IntrinsicsHistory read_intrinsics_history(const std::filesystem::path& file);

}  // namespace alidade
