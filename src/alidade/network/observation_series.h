#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/pantilt/head.h"
#include "alidade/pantilt/target_observation.h"

namespace alidade {

/// The observations of the target by one static camera, on its own clock, in the plane at depth 1.
struct ObservationSeries {
  std::vector<double> t_s;
  std::vector<Eigen::Vector2d> at;       ///< x/z, y/z of the ray.
  std::vector<std::size_t> observation;  ///< Index among all observations.
  double px = 1.0;                       ///< Pixels per unit of `at`, at the image centre.
  double spacing_s = 0.0;                ///< Median interval.

  [[nodiscard]] double mid_s() const { return 0.5 * (t_s.front() + t_s.back()); }
  /// Linear interpolation between two consecutive observations; none in gaps and where the target jumped.
  [[nodiscard]] std::optional<Eigen::Vector2d> seen_at(double time_s) const;
};

/// Series of one head; rays that point backwards (z below 0.1) are rejected.
[[nodiscard]] ObservationSeries observation_series(std::span<const TargetObservation> observations, std::size_t head,
                                                   const RigHead& rig_head);

/// Six image periods of the typical camera: a path does not curve faster, and observations between knots average.
[[nodiscard]] double knot_of(std::span<const ObservationSeries> series);

/// Each camera's rays lie in one plane, within 4 px: the target moved along a line (or in a plane with all
/// cameras), and the planes alone hardly determine where the cameras are.
[[nodiscard]] bool is_line(std::span<const ObservationSeries> series, std::size_t min_observations);

}  // namespace alidade
