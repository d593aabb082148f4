#pragma once

#include <cstddef>
#include <vector>

#include "alidade/estimation/verdict.h"
#include "alidade/observe/solve/solve.h"
#include "alidade/pantilt/rotation_log.h"

namespace alidade {

/// Rows [begin, end) during which the camera stands still.
struct Stop {
  std::size_t begin = 0, end = 0;
  [[nodiscard]] std::size_t size() const { return end - begin; }
  [[nodiscard]] std::size_t middle() const { return begin + size() / 2; }
};

/// A camera at rest has one error of its readings and of the point detector, not one per row: n rows counted as
/// independent divide its variance by n, and its change from stop to stop looks like a zoom.
struct StandingRows {
  std::vector<Stop> stops;
  double sigma_within_px = 0.0;  ///< σ of a coordinate about its median over a stop.

  [[nodiscard]] std::size_t num_rows() const;
};

/// Stops of five consecutive rows or more whose rotation is within 0.1°, and most of whose points are within 1 px, of
/// those of their first row.
[[nodiscard]] StandingRows standing_rows(const RotationLog& log);

/// The log with one image per stop, in its middle row: the median of the pixels, and the mean of a head's angles. The
/// other rows of a stop have no pixels.
[[nodiscard]] RotationLog with_each_stop_once(const RotationLog& log, const StandingRows& standing);

/// The share of the pixels' variance that the rows of a stop have in common, from
/// the residuals of the medians after one camera is adjusted to them; 0: none.
[[nodiscard]] double shared_within_stops(const ObserveSolution& each_once, const RotationLog& log,
                                         const StandingRows& standing);

[[nodiscard]] Check standing_check(const ObserveSolution& each_once, const StandingRows& standing);

}  // namespace alidade
