#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/geometry/similarity.h"

namespace alidade {

/// What two keyframes say of each other: the second's frame in the first's, in the first's unit of length.
struct SimilarityEdge {
  std::size_t from = 0, to = 0;
  Similarity from_from_to;
  double sigma_rad = 0.003, sigma_length = 0.01, sigma_log_scale = 0.01;
  bool is_loop = false;  ///< Found, not followed: may be wrong.
};

/// Keyframes with their loops closed, and which edges hold.
struct SimilarityGraph {
  std::vector<Similarity> world_from_keyframe;
  std::vector<bool> holds;  ///< One per edge.
};

/// Of keyframes along a path whose position, rotation and scale drift (H. Strasdat et al., "Scale Drift-Aware Large
/// Scale Monocular SLAM", RSS 2010), by Gauss–Newton from where they are given; the first stays. Loops weigh less the
/// less they agree with all others, from all alike to Geman & McClure's weights (H. Yang et al., "Graduated
/// Non-Convexity for Robust Spatial Perception", RA-L 5(2), 2020). None where it does not settle.
[[nodiscard]] std::optional<SimilarityGraph> settled_graph(std::vector<Similarity> world_from_keyframe,
                                                           std::span<const SimilarityEdge> edges);

[[nodiscard]] Similarity inverse(const Similarity& b_from_a);
[[nodiscard]] Similarity operator*(const Similarity& second, const Similarity& first);  ///< After the first the second.
[[nodiscard]] Eigen::Vector3d operator*(const Similarity& similarity, const Eigen::Vector3d& point_in_a);

}  // namespace alidade
