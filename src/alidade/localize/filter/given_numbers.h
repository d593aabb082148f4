#pragma once

#include "alidade/localize/filter/filter.h"
#include "alidade/localize/path/path_smoother.h"

namespace alidade {

/// What is left of a path's normal equations for the parameters that are given: those of the lens by their indices in
/// it, then the target's scale; of a smoothed path also its shape, its speed (3), the image's readout and its rotation
/// (3).
struct GivenSystem {
  const Camera& camera;
  const std::vector<int>& lens_params;
  const Eigen::MatrixXd& cov;   ///< Counted; zero where none is known.
  const Eigen::VectorXd score;  ///< Jᵀr by each, all else at its best,
  const Eigen::MatrixXd& information;
  const Eigen::MatrixXd score_cov;                                      ///< As errors are, where that is more.
  const std::vector<Eigen::Matrix<double, 6, Eigen::Dynamic>>& J_pose;  ///< How poses move with each.
  const std::vector<Eigen::Matrix<double, 6, 6>>& pose_cov;
};

/// Focal length (relative), centre (px), k1 (absolute, in a hundredth) and scale of the target (relative), as far as
/// they are given and not estimated; of a port that has no covariance, the water's index, the gap (m) and the normal.
/// Then of a smoothed path: shape of the target (x longer and y shorter, relative), its speed (m/s), readout (s), and
/// how fast the target rotates about its centre (rad/s).
[[nodiscard]] std::vector<GivenNumber> given_numbers(const GivenSystem& system);

/// What was given to a filter, over a run: the largest moves of its poses, and what its observations said.
class GivenTally {
 public:
  void add(const LocalizationFilter& filter);
  [[nodiscard]] const std::vector<GivenNumber>& numbers() const { return numbers_; }
  /// What the observations said since this was last asked: the first ones, while depths are vague, say less of the lens
  /// than their derivatives make them seem to.
  [[nodiscard]] std::vector<GivenNumber> take_recent(const LocalizationFilter& filter);

 private:
  struct Said {
    Eigen::VectorXd score;
    Eigen::MatrixXd information, score_cov;
  };
  Said before_;  ///< When it was last asked.
  std::vector<GivenNumber> numbers_;
};

/// A change of a pose, by its right perturbation: the largest in σ is kept.
void take_move(const Eigen::Vector<double, 6>& move, const Eigen::Matrix<double, 6, 6>& cov, GivenNumber& given);

}  // namespace alidade
