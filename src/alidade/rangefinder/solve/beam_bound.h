#pragma once

#include "alidade/rangefinder/prepare.h"
#include "alidade/rangefinder/rangefinder.h"

namespace alidade {

/// Geometry and uncertainty of a beam that has its covariance: everything of BeamBound but `cov`.
[[nodiscard]] BeamBound judge_beam(const BeamProblem& problem, const Beam& beam, const Camera& camera);

/// Ratio of the largest to the least eigenvalue after scaling to a unit diagonal; infinite where it is singular.
[[nodiscard]] double scaled_condition(const Eigen::MatrixXd& information);
/// The inverse of an information whose diagonal spans many powers of ten.
[[nodiscard]] Eigen::MatrixXd inverse_of_scaled(const Eigen::MatrixXd& information);

}  // namespace alidade
