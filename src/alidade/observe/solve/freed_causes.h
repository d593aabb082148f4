#pragma once

#include <string>

#include "alidade/observe/solve/solve.h"

namespace alidade {

inline constexpr const char* lever_cause = "lever";

[[nodiscard]] bool is_answer(const ObserveSolution& report);

/// Frees what the cause names, "k1,k2", "mount", "backlash". False: it cannot be estimated, or is already.
[[nodiscard]] bool free_cause(const std::string& cause, const RotationLog& log, ObserveSetup& config);

/// The cause that explains the residuals best, of those that are asked for; of several that do nearly as well the one
/// with the fewest parameters: what it leaves is asked for next. Null: none is.
[[nodiscard]] const CauseScore* best_cause(const ObserveSolution& report, bool is_no_lever = false);

/// A lever was estimated that no head has, and frames err as a whole beside it: with points whose distances are free
/// it explains a part of the rotation's noise. One that is there explains all.
[[nodiscard]] bool has_absurd_lever(const ObserveSolution& report);

}  // namespace alidade
