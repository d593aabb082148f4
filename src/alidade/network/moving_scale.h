#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/geometry/similarity.h"
#include "alidade/pantilt/target_observation.h"

namespace alidade {

/// How a path lies on a true one that has a clock of its own.
struct PathMatch {
  Similarity truth_from_path;
  double offset_s = 0.0, rate = 1.0;  ///< Time of the truth = offset + rate · time of the path.
  double covered = 0.0;               ///< Share of the path that the truth covers.
  double median_m = 0.0, rms_m = 0.0, sigma_scale = 0.0;
  double extent_m = 0.0;  ///< RMS distance of the path from its centroid.
  /// Of the similarity about that centroid, in the truth's world; what is left of the path varies slowly, and counts
  /// so.
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  double sigma_translation_m = 0.0;  ///< Along each axis.
  Eigen::Matrix3d cov_rotation = Eigen::Matrix3d::Zero();
};

/// The similarity and clock that bring a path (in any unit) onto a true one; all offsets at which the truth covers most
/// of the path are tried where `clock_is_free`. None where the truth covers less than half of the path.
[[nodiscard]] std::optional<PathMatch> match_path(std::span<const double> t_s, std::span<const Eigen::Vector3d> path,
                                                  const TrueTrack& truth, bool clock_is_free);

}  // namespace alidade
