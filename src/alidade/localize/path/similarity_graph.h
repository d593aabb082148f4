#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/geometry/similarity.h"

namespace alidade {

/// Relative pose of two keyframes: the second one's frame in the first one's, in the first one's unit of length.
struct SimilarityEdge {
  std::size_t from = 0, to = 0;
  Similarity from_from_to;
  double sigma_rad = 0.003, sigma_length = 0.01, sigma_log_scale = 0.01;
  bool is_loop = false;  ///< From a loop, not from the sequence: may be wrong.
};

/// Keyframes after loop closure, and which edges are inliers.
struct SimilarityGraph {
  std::vector<Similarity> world_from_keyframe;
  std::vector<bool> holds;  ///< One per edge.
};

/// Pose-graph optimisation of keyframes along a path that drifts in position, rotation and scale (H. Strasdat et al.,
/// "Scale Drift-Aware Large Scale Monocular SLAM", RSS 2010), by Gauss–Newton from the given poses; the first is fixed.
/// Loops are robustly weighted, from equal weights to those of Geman & McClure (H. Yang et al., "Graduated
/// Non-Convexity for Robust Spatial Perception", RA-L 5(2), 2020). Empty if it does not converge.
[[nodiscard]] std::optional<SimilarityGraph> settled_graph(std::vector<Similarity> world_from_keyframe,
                                                           std::span<const SimilarityEdge> edges);

[[nodiscard]] Similarity inverse(const Similarity& b_from_a);
[[nodiscard]] Similarity operator*(const Similarity& second, const Similarity& first);  ///< `first` is applied first.
[[nodiscard]] Eigen::Vector3d operator*(const Similarity& similarity, const Eigen::Vector3d& point_in_a);

}  // namespace alidade
