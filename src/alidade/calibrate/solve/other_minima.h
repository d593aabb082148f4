#pragma once

#include <span>
#include <vector>

#include "alidade/board/board_view.h"
#include "alidade/calibrate/solve/bundle.h"

namespace alidade {

/// Initial guesses away from `found`, if the views determine its principal point poorly (σ above a hundredth of the
/// image width): the point moved by a fifth of the width either way, no distortion, poses from the views. In a narrow
/// image a moved principal point, distortion and tilts of the boards have similar effects, and the cost may have
/// several minima. Empty if the point is well determined, or fixed. `found` must have its covariance, in units of
/// `noise_variance`.
[[nodiscard]] std::vector<BundleState> starts_elsewhere(const BundleProblem& problem, const BundleResult& found,
                                                        double noise_variance, std::span<const BoardView> views,
                                                        int width_px);

/// The minima to which solves from these guesses converge, other than `found`: without duplicates, lowest cost first.
[[nodiscard]] std::vector<BundleResult> other_minima(const BundleProblem& problem, const BundleResult& found,
                                                     const std::vector<BundleState>& starts,
                                                     const BundleConfig& config);

}  // namespace alidade
