#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "alidade/rig/rig_solve.h"

namespace alidade {

/// Derivatives of a view's whitened residuals by what is tested, from column `first` of all that is tested.
struct TestedColumns {
  Eigen::Index first = 0;
  Eigen::MatrixXd D;
};

/// What the residuals indicate of something that is tested.
struct IndicatedChange {
  Eigen::VectorXd size, variance;  ///< Of each of its columns.
  double sigmas = 0.0;             ///< Of all of it together.
  Eigen::VectorXd moves;           ///< What freeing it would change the free parameters by.
};

/// Score and information of all that is tested, everything else following. C. R. Rao, Proc. Cambridge Phil. Soc. 44,
/// 1948; docs/maths/pan-tilt-heads.md.
struct RigScore {
  Eigen::VectorXd s;
  Eigen::MatrixXd I;
  Eigen::MatrixXd by_lenses;  ///< Of it with the parameters of all heads' lenses.
  Eigen::MatrixXd moves;      ///< ∂ free parameters / ∂ what is tested, as they follow.

  /// Of the columns at `places` together; directions whose σ is above `worst` are not determined, and none is returned
  /// where all are. `given`: σ with which each was given, 0 as if exact. `cov_lenses` of all heads' lenses: what their
  /// errors do to a score is not indicated. `num_given`: degrees of freedom by which the residuals estimated σ of a
  /// reading; 0: it was given.
  [[nodiscard]] std::optional<IndicatedChange> asked(const std::vector<Eigen::Index>& places, double worst,
                                                     const Eigen::VectorXd& given, const Eigen::MatrixXd& cov_lenses,
                                                     double num_given) const;
};

/// `num`: columns in all. `columns`: of a view; none where nothing is tested in it. `cov`: of the free parameters by
/// the model.
[[nodiscard]] RigScore rig_score(const RigProblem& problem, const SolvedRig& solved, const Eigen::MatrixXd& cov,
                                 std::span<const double> weights, Eigen::Index num,
                                 const std::function<std::optional<TestedColumns>(std::size_t)>& columns);

}  // namespace alidade
