#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/network/clock_search.h"

namespace alidade {

/// Initial poses of the cameras, in the frame of one of them and with the distance between two of them as the unit.
struct MovingStart {
  struct Placed {
    bool placed = false;
    std::string reason;
    Rigid3 cam_from_world;
    double offset_s = 0.0, rate = 1.0;  ///< Time of the camera = t + offset + (rate − 1)(t − the path's midpoint).
  };
  std::vector<Placed> cameras;
  std::size_t first = 0, second = 0;  ///< The initial pair: its distance is the unit of length.
  std::vector<double> t_s;            ///< On the clock of `first`.
  std::vector<Eigen::Vector3d> path;
  bool has_common = false;  ///< Some two cameras saw the target simultaneously.
  bool found = false;
};

/// Pairs of cameras by their epipolar geometry over all offsets of their clocks, the best pair first; then camera
/// after camera by resection from the path so far. `knot_s`: step of the path; `num_better`: number of better pairs to
/// skip. Throws Interrupted.
[[nodiscard]] MovingStart start_cameras(std::span<const ObservationSeries> series, double search_s, double knot_s,
                                        std::size_t num_better, const Progress& progress);

/// Intersections of the located cameras' rays, at a step of `knot_s`.
void rebuild_path(std::span<const ObservationSeries> series, double knot_s, MovingStart& start);

}  // namespace alidade
