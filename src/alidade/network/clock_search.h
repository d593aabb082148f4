#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/geometry/rigid3.h"
#include "alidade/network/observation_series.h"

namespace alidade {

/// Two cameras whose observations agree if the second's clock is offset from the first's by this.
struct ObservationPair {
  std::size_t first = 0, second = 0;
  double offset_s = 0.0;  ///< Time of the second − time of the first, at the same moment.
  double share = 0.0;     ///< Fraction of the common observations that agree.
  std::size_t num_common = 0;
};

/// The offset within ± search_s at which the most common observations fit one epipolar geometry, in steps of 0.05 s;
/// none without enough common observations. search_s 0: one common clock. Throws Interrupted.
[[nodiscard]] std::optional<ObservationPair> agreeing_offset(std::span<const ObservationSeries> series,
                                                             std::size_t first, std::size_t second, double search_s,
                                                             const Progress& progress);

/// cam_from_cam(second, first), translation of length 1, and the target's positions (time of the first, point in the
/// first camera). By agreeing_essential().
struct RelativePose {
  Rigid3 cam_from_first;
  std::vector<double> t_s;
  std::vector<Eigen::Vector3d> point_in_first;
};
[[nodiscard]] std::optional<RelativePose> relative_pose(const ObservationSeries& first, const ObservationSeries& second,
                                                        double offset_s);

/// The pose of a camera from points at times by its own clock, and how many of them agree.
struct Resection {
  Rigid3 cam_from_world;
  double share = 0.0;
  std::size_t num_common = 0;
};
/// `rate`: of the camera's clock relative to that of the points, about the midpoint of the points' times.
[[nodiscard]] std::optional<Resection> resection(const ObservationSeries& camera, std::span<const double> t_s,
                                                 std::span<const Eigen::Vector3d> point_in_world, double offset_s,
                                                 double rate);

}  // namespace alidade
