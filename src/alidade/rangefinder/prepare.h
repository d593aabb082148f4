#pragma once

#include <string>

#include "alidade/rangefinder/rangefinder.h"
#include "alidade/rangefinder/solve/beam_solve.h"
#include "alidade/rangefinder/solve/refine_all.h"

namespace alidade {

/// The caller's shots made ready: checked, boards' poses solved, each σ that is known in its place.
struct Preparation {
  BeamProblem problem;
  std::vector<std::string> reasons;  ///< One per shot: why it cannot be used; empty otherwise.
  double sigma_corner_px = 0.0;
  bool knows_spot_sigma = true, knows_range_sigma = true;
  double min_sigma_range_m = 0.0;  ///< Readings in steps of q scatter by q/√12 at least, whatever their residuals.
};

/// Initial σ where none is given, before it is estimated from the residuals: a centroid, a cheap rangefinder.
inline constexpr double guessed_sigma_px = 0.3;
inline constexpr double guessed_sigma_m = 0.002;

/// Whether the camera could have seen something at a pixel, but for an edge of one.
[[nodiscard]] bool may_be_in_image(const Camera& camera, const Eigen::Vector2d& px);

[[nodiscard]] Preparation prepare_shots(std::span<const Shot> shots, std::span<const Eigen::Vector3d> points_in_board,
                                        const Camera& camera, const RangefinderConfig& config);

/// What is known of the shots before anything is solved: none is used yet.
[[nodiscard]] RangefinderReport report_before_solving(const Preparation& ready, std::span<const Shot> shots,
                                                      std::span<const Eigen::Vector3d> points_in_board,
                                                      const Camera& camera, const RangefinderConfig& config);

}  // namespace alidade
