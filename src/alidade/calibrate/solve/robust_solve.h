#pragma once

#include <vector>

#include "alidade/calibrate/calibrate.h"
#include "alidade/calibrate/solve/bundle.h"
#include "alidade/calibrate/solve/weights.h"

namespace alidade {

/// The views that are used, and what is known of them so far.
struct CalibrationWork {
  std::vector<std::size_t> number;  ///< Index of each in the caller's views.
  std::vector<BoardView> views;
  std::vector<std::vector<bool>> far;  ///< Corners that are not used for the initial guess.
  std::vector<ViewArrays> arrays;
  BundleProblem problem;
  bool use_covariances = false;
};

/// Rejects a view, with the reason in the report.
void drop_view(std::size_t at, const std::string& reason, CalibrateReport& report, CalibrationWork& work,
               BundleState& state);

/// All corners with the same weight, except that far ones get none if outliers are to be rejected.
void make_all_arrays(const CalibrateConfig& config, CalibrationWork& work);

/// p: free lens, pose and board parameters.
[[nodiscard]] int num_parameters(const CalibrationWork& work);

/// s² of the whitened residuals.
[[nodiscard]] double variance_of(const CalibrationWork& work, const BundleResult& result, const NoiseEstimate& noise);

/// The lowest minimum of the cost that was found, and the others.
struct Minima {
  BundleResult least;
  bool settled = false;  ///< The lowest one has converged.
  std::vector<BundleResult> others;
};

/// Solves from an initial guess, with covariance: weights from the residuals, outliers rejected, and of several minima
/// (if the views may have some) the lowest.
[[nodiscard]] Minima solve_robustly(const CalibrateConfig& config, ImageSize size, BundleState start,
                                    CalibrateReport& report, CalibrationWork& work, NoiseEstimate& noise);

}  // namespace alidade
