#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "alidade/rig/rig_solve.h"

namespace alidade {

/// Derivatives of a view's whitened residuals with respect to one tested quantity, from column `first` of all tested.
struct TestedColumns {
  Eigen::Index first = 0;
  Eigen::MatrixXd D;
};

/// What the residuals indicate of one tested quantity.
struct IndicatedChange {
  Eigen::VectorXd size, variance;  ///< Of each of its columns.
  double sigmas = 0.0;             ///< Joint significance of its columns.
  Eigen::VectorXd moves;           ///< Change of the free parameters if it were freed.
};

/// Score and information of all tested quantities, everything else following. C. R. Rao, Proc. Cambridge Phil. Soc. 44,
/// 1948; docs/maths/pan-tilt-heads.md.
struct RigScore {
  Eigen::VectorXd s;
  Eigen::MatrixXd I;
  Eigen::MatrixXd by_lenses;  ///< Cross-information with the parameters of all heads' lenses.
  Eigen::MatrixXd moves;      ///< ∂ free parameters / ∂ tested quantities.

  /// For the columns at `places` jointly; directions with σ above `worst` count as undetermined; none if all are.
  /// `given`: σ with which each was given, 0 as exact. `cov_lenses` of all heads' lenses: the effect of their
  /// errors on a score is no indication. `num_given`: degrees of freedom from which the residuals estimated σ of a
  /// reading; 0: it was given.
  [[nodiscard]] std::optional<IndicatedChange> asked(const std::vector<Eigen::Index>& places, double worst,
                                                     const Eigen::VectorXd& given, const Eigen::MatrixXd& cov_lenses,
                                                     double num_given) const;
};

/// `num`: total number of columns. `columns`: of a view; none if nothing is tested in it. `cov`: of the free
/// parameters, by the model.
[[nodiscard]] RigScore rig_score(const RigProblem& problem, const SolvedRig& solved, const Eigen::MatrixXd& cov,
                                 std::span<const double> weights, Eigen::Index num,
                                 const std::function<std::optional<TestedColumns>(std::size_t)>& columns);

}  // namespace alidade
