#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "alidade/rig/rig.h"
#include "alidade/rig/rig_solve.h"

namespace alidade {

/// Is the board as it was meant? Score tests of its print, wider along its columns than along its rows, and of its
/// flatness, a surface of second order through its points. What moves no parameter of the heads by its σ is not
/// returned: boards are a little bent. Arguments as of rig_causes().
[[nodiscard]] std::vector<RigCause> board_print(const RigProblem& problem, const SolvedRig& solved,
                                                const Eigen::MatrixXd& cov, std::span<const double> weights,
                                                const Eigen::MatrixXd& cov_lenses, double num_given);

}  // namespace alidade
