#pragma once

#include "alidade/localize/filter/filter.h"
#include "alidade/localize/path/path_smoother.h"

namespace alidade {

/// The normal equations of a path, reduced to the given parameters (all else eliminated): those of the lens, by their
/// indices in it, then the scale of the target; for a smoothed path also the target's shape, its speed (3), the readout
/// time of the image and the target's rotation rate (3).
struct GivenSystem {
  const Camera& camera;
  const std::vector<int>& lens_params;
  const Eigen::MatrixXd& cov;   ///< Prior, included in σ; zero where unknown.
  const Eigen::VectorXd score;  ///< Jᵀr, with all else at its optimum.
  const Eigen::MatrixXd& information;
  const Eigen::MatrixXd score_cov;                                      ///< Cluster-robust, where larger.
  const std::vector<Eigen::Matrix<double, 6, Eigen::Dynamic>>& J_pose;  ///< ∂pose/∂each.
  const std::vector<Eigen::Matrix<double, 6, 6>>& pose_cov;
};

/// Focal length (relative), centre (px), k1 (absolute, in hundredths) and scale of the target (relative), unless they
/// are estimated; for a port without covariance also the water's index, the gap (m) and the normal.
/// For a smoothed path then: shape of the target (x longer and y shorter, relative), its speed (m/s), readout (s), and
/// rotation rate of the target about its centre (rad/s).
[[nodiscard]] std::vector<GivenNumber> given_numbers(const GivenSystem& system);

/// The given numbers of a filter over a run: the largest change of its poses by each, and its score test.
class GivenTally {
 public:
  void add(const LocalizationFilter& filter);
  [[nodiscard]] const std::vector<GivenNumber>& numbers() const { return numbers_; }
  /// Score tests from the observations since the last call. The first observations, while depths are uncertain, carry
  /// less information about the lens than their derivatives suggest.
  [[nodiscard]] std::vector<GivenNumber> take_recent(const LocalizationFilter& filter);

 private:
  struct Said {
    Eigen::VectorXd score;
    Eigen::MatrixXd information, score_cov;
  };
  Said before_;  ///< State at the last call.
  std::vector<GivenNumber> numbers_;
};

/// Keeps the component of a pose change (right perturbation) that is the largest relative to its σ.
void take_move(const Eigen::Vector<double, 6>& move, const Eigen::Matrix<double, 6, 6>& cov, GivenNumber& given);

}  // namespace alidade
