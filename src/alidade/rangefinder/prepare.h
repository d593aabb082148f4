#pragma once

#include <string>

#include "alidade/rangefinder/rangefinder.h"
#include "alidade/rangefinder/solve/beam_solve.h"
#include "alidade/rangefinder/solve/refine_all.h"

namespace alidade {

/// The caller's shots prepared for the solver: checked, board poses solved, every known σ set.
struct Preparation {
  BeamProblem problem;
  std::vector<std::string> reasons;  ///< One per shot: why it cannot be used; empty otherwise.
  double sigma_corner_px = 0.0;
  bool knows_spot_sigma = true, knows_range_sigma = true;
  double min_sigma_range_m = 0.0;  ///< Lower bound: readings quantised in steps of q scatter by at least q/√12.
};

/// Initial σ if none is given, before the estimate from the residuals: a centroid, a cheap rangefinder.
inline constexpr double guessed_sigma_px = 0.3;
inline constexpr double guessed_sigma_m = 0.002;

/// Whether a pixel is inside the image, with a margin of 1 px around it; true if the image size is unknown.
[[nodiscard]] bool may_be_in_image(const Camera& camera, const Eigen::Vector2d& px);

[[nodiscard]] Preparation prepare_shots(std::span<const Shot> shots, std::span<const Eigen::Vector3d> points_in_board,
                                        const Camera& camera, const RangefinderConfig& config);

/// What is known of the shots before any solve; none is used yet.
[[nodiscard]] RangefinderReport report_before_solving(const Preparation& ready, std::span<const Shot> shots,
                                                      std::span<const Eigen::Vector3d> points_in_board,
                                                      const Camera& camera, const RangefinderConfig& config);

}  // namespace alidade
