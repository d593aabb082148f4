#pragma once

#include <span>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/rangefinder/rangefinder.h"

namespace alidade {

/// What the first so many shots, in a drawn order, tell of the beam.
struct CountedSigma {
  int num_shots = 0;
  double sigma_origin_m = 0.0, sigma_direction_rad = 0.0;  ///< √trace of the estimate's covariances.
  double bound_origin_m = 0.0, bound_direction_rad = 0.0;  ///< √trace of the Cramér–Rao bound's.
};

/// σ against the number of shots that `report` used; counts that cannot tell are left out. Throws Interrupted.
[[nodiscard]] std::vector<CountedSigma> sigma_by_count(std::span<const Shot> shots, const RangefinderReport& report,
                                                       std::span<const Eigen::Vector3d> points_in_board,
                                                       const Camera& camera, const RangefinderConfig& config,
                                                       const Progress& progress = {});

/// A shot as the others predict it; NaN where there is nothing to compare.
struct LeftOutShot {
  std::size_t index = 0;
  double residual_range_m = 0.0;  ///< Predicted from its board − read.
  Eigen::Vector2d residual_px;    ///< Predicted from its reading − seen.
};

/// Every used shot (of many, 60 evenly chosen) against the beam of the others: the error to expect of a new shot.
/// Throws Interrupted.
[[nodiscard]] std::vector<LeftOutShot> leave_one_out(std::span<const Shot> shots, const RangefinderReport& report,
                                                     std::span<const Eigen::Vector3d> points_in_board,
                                                     const Camera& camera, const RangefinderConfig& config,
                                                     const Progress& progress = {});

}  // namespace alidade
