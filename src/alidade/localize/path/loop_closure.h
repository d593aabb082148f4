#pragma once

#include <map>

#include "alidade/localize/path/path_smoother.h"

namespace alidade {

/// Result of closing the loops of a path.
struct LoopClosure {
  std::size_t num_loops = 0;     ///< Pairs of keyframes with common points at different times that are consistent.
  std::size_t num_rejected = 0;  ///< Pairs that are inconsistent.
  std::size_t num_joined = 0;    ///< Points that were merged.
};

/// A point that left the map and was seen again much later is in `problem` twice, under two ids; `number_of` maps both
/// to the same number. The path has drifted in between. Pose-graph optimisation over keyframes makes the positions of
/// such points consistent (similarity_graph.h) and corrects the initial poses and points. Of the points that then
/// agree, as many are merged, evenly along the path, as keep at most `max_at_once` points in the equations at a time.
/// The others remain two points: that they are the same is not used.
LoopClosure close_loops(const std::map<long, long>& number_of, double max_at_once, SmootherProblem& problem);

/// Whether merged points are really the same: the closed path fits the observations as well as the open one, apart from
/// the error of detecting the same corner again, a quarter of a pixel (a hundred in σ² over some forty observations of
/// each). A wrong match of a place a metre away bends the path and costs ten times that. Both use the same weights.
[[nodiscard]] bool fits_as_well(const SmoothedPath& closed, const SmoothedPath& open, std::size_t num_joined,
                                double gate);

}  // namespace alidade
