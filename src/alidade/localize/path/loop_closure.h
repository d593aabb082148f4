#pragma once

#include <map>

#include "alidade/localize/path/path_smoother.h"

namespace alidade {

/// What closing the loops of a path came to.
struct LoopClosure {
  std::size_t num_loops = 0;     ///< Pairs of keyframes that see the same points at different times, and agree.
  std::size_t num_rejected = 0;  ///< That do not.
  std::size_t num_joined = 0;    ///< Points that are one again.
};

/// Where a point left the map and was seen again much later, `problem` has two, with numbers of their own: `number_of`
/// them is the same. Between the two the path has drifted. Here keyframes are made to agree on the positions of such
/// points (similarity_graph.h), poses and points to begin at follow, and of the points that agree then so many are
/// joined to one that no more than `max_at_once` are in the equations at once; evenly along the path. The others stay
/// two: that they are one is not used.
LoopClosure close_loops(const std::map<long, long>& number_of, double max_at_once, SmootherProblem& problem);

/// Whether points that were joined are one: the path with them explains the observations but for what the same corner,
/// chosen anew, is off by, a quarter of a pixel (a hundred in σ² over some forty observations of each). A place taken
/// for one a metre away bends the path, and costs ten times that. Both by the same weights.
[[nodiscard]] bool fits_as_well(const SmoothedPath& closed, const SmoothedPath& open, std::size_t num_joined,
                                double gate);

}  // namespace alidade
