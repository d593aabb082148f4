#pragma once

#include "alidade/rangefinder/prepare.h"
#include "alidade/rangefinder/rangefinder.h"

namespace alidade {

/// Geometry and uncertainty of a beam with known covariance: all members of BeamBound except `cov`.
[[nodiscard]] BeamBound judge_beam(const BeamProblem& problem, const Beam& beam, const Camera& camera);

/// Ratio of the largest to the smallest eigenvalue after scaling to a unit diagonal; infinite if singular.
[[nodiscard]] double scaled_condition(const Eigen::MatrixXd& information);
/// Inverse of an information matrix whose diagonal spans many orders of magnitude.
[[nodiscard]] Eigen::MatrixXd inverse_of_scaled(const Eigen::MatrixXd& information);

}  // namespace alidade
