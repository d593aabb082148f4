#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "alidade/rig/rig.h"
#include "alidade/rig/rig_solve.h"

namespace alidade {

/// Were boards moved between the views of one head and those of another (taken one head after the other)? A score test
/// of a displacement of each shared board in the views of each head but the first that sees it, all jointly; a common
/// displacement of the boards is the pose of the head. Size: root mean square of the displacements beyond their noise
/// [m]. None without shared boards. With many boards, a hundred displacements are tested. Arguments as of rig_causes().
[[nodiscard]] std::optional<RigCause> moved_boards(const RigProblem& problem, const SolvedRig& solved,
                                                   const Eigen::MatrixXd& cov, std::span<const double> weights,
                                                   const Eigen::MatrixXd& cov_lenses, double num_given);

}  // namespace alidade
