#pragma once

#include <span>
#include <vector>

#include "alidade/board/board_view.h"
#include "alidade/calibrate/solve/view_arrays.h"

namespace alidade {

/// Noise of the corners according to the residuals: the part that their own covariances do not explain, and the
/// outliers. A corner's covariance in the solve is its own plus excess² · I.
struct NoiseEstimate {
  double excess_px = 0.0;
  std::vector<std::vector<bool>> used;  ///< By view and corner.
  std::size_t num_dropped = 0;
};

/// True if some corner has a covariance of its own (not the identity, which means "unknown").
[[nodiscard]] bool have_covariances(std::span<const BoardView> views);

/// Robust estimate from residuals [px] by view and corner. The scale is the median of |r| (up to ½ of the corners may
/// be wrong), then, over the corners within `outlier_sigmas`, the excess for which χ² equals its degrees of freedom (2N
/// − `num_parameters`); both repeated. Rousseeuw & Leroy, "Robust regression and outlier detection", 1987, §5.1.
[[nodiscard]] NoiseEstimate estimate_noise(std::span<const BoardView> views,
                                           const std::vector<std::vector<Eigen::Vector2d>>& residuals,
                                           bool use_covariances, bool reject, double outlier_sigmas,
                                           int num_parameters);

/// Whiteners of a view for the estimate; unused corners get none. `huber_sigmas` > 0 also lowers the
/// weight of corners with larger residuals than that.
void set_whiteners(const BoardView& view, const std::vector<Eigen::Vector2d>& residuals, const NoiseEstimate& noise,
                   const std::vector<bool>& used, bool use_covariances, double huber_sigmas, ViewArrays& arrays);

}  // namespace alidade
