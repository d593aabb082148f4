#pragma once

#include <span>
#include <vector>

#include "alidade/estimation/cluster_covariance.h"
#include "alidade/servo/identify/identify.h"

namespace alidade {

/// Number of consecutive rows that share an error: the first lag at which the residuals' correlation is within its
/// noise, at least 1, at most a quarter of the rows.
[[nodiscard]] std::size_t correlated_rows(std::span<const double> residual_rad);

/// Covariance of a servo's parameters with coloured residuals or an incomplete model. Clusters are
/// blocks of rows, twice as long as the correlation; `J`: by the parameters, `inverse`: its (JᵀJ)⁻¹. Under the model, a
/// block's scores vary according to the residuals' autocovariance (stationary noise of any colour); the scatter of the
/// blocks in excess of that is added.
[[nodiscard]] ClusterCovariance servo_clusters(std::span<const double> residual_rad, const Eigen::MatrixXd& J,
                                               const Eigen::MatrixXd& inverse);

}  // namespace alidade
