#pragma once

#include <cstddef>
#include <vector>

#include "alidade/estimation/verdict.h"
#include "alidade/observe/solve/solve.h"
#include "alidade/pantilt/rotation_log.h"

namespace alidade {

/// Rows in which the camera stands at one place.
struct Stop {
  std::size_t begin = 0, end = 0;
  [[nodiscard]] std::size_t size() const { return end - begin; }
  [[nodiscard]] std::size_t middle() const { return begin + size() / 2; }
};

/// A camera that stands has one error of its readings and of the point finder, not one per row: n rows that count as
/// independent divide its variance by n, and from stop to stop it is a zoom.
struct StandingRows {
  std::vector<Stop> stops;
  double sigma_within_px = 0.0;  ///< Of a coordinate about its median over a stop.

  [[nodiscard]] std::size_t num_rows() const;
};

/// Stops of five rows and more, consecutive, whose rotation is within 0.1°, and most of whose points are within a
/// pixel, of those of the first.
[[nodiscard]] StandingRows standing_rows(const RotationLog& log);

/// The log with one image per stop, in its middle row: the pixels' median, and the mean of a head's angles. Its other
/// rows have no pixels.
[[nodiscard]] RotationLog with_each_stop_once(const RotationLog& log, const StandingRows& standing);

/// The share of the pixels' variance that the rows of a stop have in common, by what is left of their medians once one
/// camera is adjusted to these; 0: none.
[[nodiscard]] double shared_within_stops(const ObserveSolution& each_once, const RotationLog& log,
                                         const StandingRows& standing);

[[nodiscard]] Check standing_check(const ObserveSolution& each_once, const StandingRows& standing);

}  // namespace alidade
