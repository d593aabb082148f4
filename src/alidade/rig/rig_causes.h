#pragma once

#include <Eigen/Core>
#include <vector>

#include "alidade/rig/rig.h"
#include "alidade/rig/rig_given.h"
#include "alidade/rig/rig_solve.h"

namespace alidade {

/// What is tested, and what causes that are indicated and not estimated leave uncertain.
struct RigCauses {
  std::vector<RigCause> all;  ///< Largest first.
  Eigen::VectorXd moves;      ///< Of the free parameters, by the one of them that moves most: counts as a σ.
};

/// Score (Lagrange multiplier) tests: what the residuals would gain if one more thing were free. Of each lens its focal
/// length, centre and a radial distortion beside its own; of each encoder with a fixed scale its scale; of each axis an
/// error of one and of two periods per turn (an eccentric or a tilted disc; a warped one), its backlash, and a drift of
/// its zero over the views as they were taken; of each base a drift of its pose; of boards a move between heads. One
/// linearisation, all else following. `assumed`, with the scales' σ, and `cov_lenses` of all heads'
/// lenses: what errors of these do to a score is no cause. `cov`: of the free parameters by the model. `num_given`:
/// degrees of freedom by which the residuals estimated σ of a reading; 0: it was given. `inflation`: of variances, by
/// errors that are shared within views. C. R. Rao, Proc. Cambridge Phil. Soc. 44, 1948; docs/maths/pan-tilt-heads.md.
[[nodiscard]] RigCauses rig_causes(const RigProblem& problem, const SolvedRig& solved, const Eigen::MatrixXd& cov,
                                   const std::vector<double>& weights, const std::vector<Assumption>& assumed,
                                   const Eigen::MatrixXd& cov_lenses, double num_given, double inflation);

}  // namespace alidade
