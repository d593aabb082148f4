#pragma once

#include "alidade/localize/path/path_smoother.h"

namespace alidade {

/// Solves the path since it began again, from all that was seen of it: poses, their covariances and events of
/// `result.path` are replaced, and how far the residuals are independent is noted. Map and lens: see take_over(). None,
/// and no change, where it does not settle.
[[nodiscard]] std::optional<SmoothedPath> smooth(const SmootherProblem& problem,
                                                 std::span<const ObservationFrame> frames, Localization& result);

}  // namespace alidade
