#pragma once

#include <span>

#include "alidade/servo/identify/identify.h"

namespace alidade {

/// Includes in the fit's covariance the effect of a dead band and backlash of typical sizes that the log hardly shows:
/// each with its prior σ, less the information of the residuals (Schmidt–Kalman's consider parameters).
/// `inverse`: (JᵀJ)⁻¹ of the parameters and freed flaws, whose derivatives are J. They are listed in `counted`.
void count_ordinary_flaws(std::span<const ServoSample> log, const Eigen::MatrixXd& J, const Eigen::MatrixXd& inverse,
                          ServoIdentification& result);

}  // namespace alidade
