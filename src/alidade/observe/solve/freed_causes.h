#pragma once

#include <string>

#include "alidade/observe/solve/solve.h"

namespace alidade {

inline constexpr const char* lever_cause = "lever";

[[nodiscard]] bool is_answer(const ObserveSolution& report);

/// Estimates the named cause, "k1,k2", "mount", "backlash". False: it cannot be estimated, or is already.
[[nodiscard]] bool free_cause(const std::string& cause, const RotationLog& log, ObserveSetup& config);

/// The indicated cause that explains the residuals best; of several that do so nearly as well, the one with the fewest
/// parameters: the rest is found in the next round. Null: none is indicated.
[[nodiscard]] const CauseScore* best_cause(const ObserveSolution& report, bool is_no_lever = false);

/// Whether the estimated lever is implausible for a head while frames still have common errors: with free distances of
/// the points, a lever explains part of the noise of the rotation. A real lever would explain all.
[[nodiscard]] bool has_absurd_lever(const ObserveSolution& report);

}  // namespace alidade
