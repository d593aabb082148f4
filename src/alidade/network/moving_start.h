#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/network/clock_search.h"

namespace alidade {

/// First poses of the cameras, in the frame of one of them and with the distance of two of them as the unit.
struct MovingStart {
  struct Placed {
    bool placed = false;
    std::string reason;
    Rigid3 cam_from_world;
    double offset_s = 0.0, rate = 1.0;  ///< Time of the camera = t + offset + (rate − 1)(t − the path's midpoint).
  };
  std::vector<Placed> cameras;
  std::size_t first = 0, second = 0;  ///< The pair that it began with: the unit of length.
  std::vector<double> t_s;            ///< By the clock of `first`.
  std::vector<Eigen::Vector3d> path;
  bool has_common = false;  ///< Two cameras saw the target together at all.
  bool found = false;
};

/// Pairs of cameras by their epipolar geometry over all differences of their clocks, the best pair first; then camera
/// after camera by the path so far. `knot_s`: step of the path; `num_better`: pairs before which it does not begin.
/// Throws Interrupted.
[[nodiscard]] MovingStart start_cameras(std::span<const ObservationSeries> series, double search_s, double knot_s,
                                        std::size_t num_better, const Progress& progress);

/// Where the located cameras' rays meet, at a step of `knot_s`.
void rebuild_path(std::span<const ObservationSeries> series, double knot_s, MovingStart& start);

}  // namespace alidade
