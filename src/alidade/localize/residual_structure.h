#pragma once

#include <Eigen/Core>
#include <span>
#include <string>

#include "alidade/localize/path_smoother.h"

namespace alidade {

/// What residuals share that are said to be independent.
struct ResidualStructure {
  double colour = 0.0;        ///< Correlation of a point's residual with that of the frame before.
  double sigma_colour = 1.0;  ///< Of that, were they independent.
  /// Whether that is more than chance and worth a word.
  [[nodiscard]] bool has_colour() const { return colour > 0.25 && colour > 4.0 * sigma_colour; }
  double place_chi2 = 0.0;   ///< Of the mean residuals of 4 × 3 parts of the image, over their count: 1 where right.
  double place_limit = 1e9;  ///< 99.9 % of that.
  double worst_px = 0.0;     ///< The largest mean,
  std::string worst_place;   ///< and where: "upper left".
};

/// `residuals`: in the order of frames.
[[nodiscard]] ResidualStructure residual_structure(std::span<const PlacedResidual> residuals, int width_px,
                                                   int height_px);

}  // namespace alidade
