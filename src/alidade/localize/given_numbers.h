#pragma once

#include "alidade/localize/path_smoother.h"

namespace alidade {

/// What is left of a smoothed path's normal equations for the numbers that are given: those of the lens by their places
/// in it, then the target's scale.
struct GivenSystem {
  const Camera& camera;
  const std::vector<int>& lens_params;
  const Eigen::MatrixXd& cov;   ///< Counted; zero where none is known.
  const Eigen::VectorXd score;  ///< Jᵀr by each, all else at its best,
  const Eigen::MatrixXd& information;
  const std::vector<Eigen::Matrix<double, 6, Eigen::Dynamic>>& J_pose;  ///< How poses move with each.
  const std::vector<Eigen::Matrix<double, 6, 6>>& pose_cov;
};

/// Focal length (relative), centre (px), k1 (absolute, in a hundredth) and scale of the target (relative), as far as
/// they are given and not estimated.
[[nodiscard]] std::vector<GivenNumber> given_numbers(const GivenSystem& system);

}  // namespace alidade
