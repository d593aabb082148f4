#pragma once

#include <span>
#include <vector>

#include "alidade/estimation/cluster_covariance.h"
#include "alidade/servo/identify/identify.h"

namespace alidade {

/// How many rows in a row share an error: the first lag at which the residuals' correlation is lost in its own noise,
/// at least 1, at most a quarter of the rows.
[[nodiscard]] std::size_t correlated_rows(std::span<const double> residual_rad);

/// Covariance of a servo's parameters where its residuals are coloured or come from what the model lacks. Clusters are
/// blocks of rows, twice as long as rows share errors; `J` by the parameters, `inverse` its (JᵀJ)⁻¹. By the model a
/// block's scores vary as the residuals' own autocovariance says (stationary noise of any colour); what the blocks
/// scatter beyond it is on top.
[[nodiscard]] ClusterCovariance servo_clusters(std::span<const double> residual_rad, const Eigen::MatrixXd& J,
                                               const Eigen::MatrixXd& inverse);

}  // namespace alidade
