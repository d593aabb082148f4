#pragma once

#include <Eigen/Core>
#include <vector>

#include "alidade/rig/rig.h"
#include "alidade/rig/rig_given.h"
#include "alidade/rig/rig_solve.h"

namespace alidade {

/// The tested causes, and the uncertainty due to indicated causes that are not estimated.
struct RigCauses {
  std::vector<RigCause> all;  ///< Largest first.
  Eigen::VectorXd moves;      ///< Shift of the free parameters by the cause that shifts them most: counted as a σ.
};

/// Score (Lagrange multiplier) tests: the gain in the residuals if one more quantity were free. Of each lens the focal
/// length, centre and an additional radial distortion; of each encoder with a fixed scale the scale; of each axis an
/// error with one and with two periods per revolution (an eccentric or tilted disc; a warped one), the backlash, and a
/// drift of the zero over the views in the order taken; of each base a drift of its pose; of boards a move between
/// heads. One linearisation, all else following. `assumed`, with σ of the scales, and `cov_lenses` of all heads'
/// lenses: effects of their errors are no cause. `cov`: of the free parameters, by the model. `num_given`:
/// degrees of freedom from which the residuals estimated σ of a reading; 0: given. `inflation`: of variances, due to
/// errors shared within views. C. R. Rao, Proc. Cambridge Phil. Soc. 44, 1948; docs/maths/pan-tilt-heads.md.
[[nodiscard]] RigCauses rig_causes(const RigProblem& problem, const SolvedRig& solved, const Eigen::MatrixXd& cov,
                                   const std::vector<double>& weights, const std::vector<Assumption>& assumed,
                                   const Eigen::MatrixXd& cov_lenses, double num_given, double inflation);

}  // namespace alidade
