#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "alidade/geometry/similarity.h"
#include "alidade/pantilt/target_observation.h"

namespace alidade {

/// Registration of a path to a true one that has its own clock.
struct PathMatch {
  Similarity truth_from_path;
  double offset_s = 0.0, rate = 1.0;  ///< Time of the truth = offset + rate · time of the path.
  double covered = 0.0;               ///< Fraction of the path that the truth covers.
  double median_m = 0.0, rms_m = 0.0;
  double extent_m = 0.0;                             ///< RMS distance of the path from its centroid.
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  ///< The centroid, in the truth's world.
  double middle_s = 0.0;                             ///< Midpoint of the path's times.
  /// About `middle` and `middle_s`, in the truth's world: translation [m], rotation [rad], ln scale, the clock's offset
  /// [s] and rate. If the clock is not free, the last two are 0, and an insignificant clock error that is indicated is
  /// included in the others. The residuals of the path vary slowly, and are treated as such.
  Eigen::Matrix<double, 9, 9> cov = Eigen::Matrix<double, 9, 9>::Zero();
  /// By how much the truth's times are late if its clock is not free, and σ.
  double late_s = 0.0, sigma_late_s = 0.0;

  [[nodiscard]] double sigma_scale() const { return std::sqrt(cov(6, 6)); }
  /// σ² of the truth's time at a time of the path.
  [[nodiscard]] double variance_of_time(double path_s) const {
    const double apart_s = path_s - middle_s;
    return cov(7, 7) + apart_s * (2.0 * cov(7, 8) + apart_s * cov(8, 8));
  }
};

/// The similarity and clock that register a path (in any unit) to a true one; all offsets at which the truth covers
/// most of the path are tried if `clock_is_free`. None if the truth covers less than half of the path.
[[nodiscard]] std::optional<PathMatch> match_path(std::span<const double> t_s, std::span<const Eigen::Vector3d> path,
                                                  const TrueTrack& truth, bool clock_is_free);

}  // namespace alidade
