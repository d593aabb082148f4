#pragma once

#include <span>

#include "alidade/servo/identify/identify.h"

namespace alidade {

/// Counts in the fit's covariance what a dead band and backlash of ordinary sizes would do that the log hardly shows:
/// each with its own σ before the log, less what the residuals say of it (Schmidt–Kalman's consider parameters).
/// `inverse`: (JᵀJ)⁻¹ of the parameters and freed flaws, whose derivatives are J. They are listed in `counted`.
void count_ordinary_flaws(std::span<const ServoSample> log, const Eigen::MatrixXd& J, const Eigen::MatrixXd& inverse,
                          ServoIdentification& result);

}  // namespace alidade
