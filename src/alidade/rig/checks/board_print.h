#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "alidade/rig/rig.h"
#include "alidade/rig/rig_solve.h"

namespace alidade {

/// Does the board match its description? Score tests of its print (longer along its columns than along its rows) and of
/// its flatness (a surface of second order through its points). An error that moves no parameter of the heads by its σ
/// is not returned: most boards are slightly bent. Arguments as of rig_causes().
[[nodiscard]] std::vector<RigCause> board_print(const RigProblem& problem, const SolvedRig& solved,
                                                const Eigen::MatrixXd& cov, std::span<const double> weights,
                                                const Eigen::MatrixXd& cov_lenses, double num_given);

}  // namespace alidade
