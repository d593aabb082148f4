#pragma once

#include "alidade/spot/spot_signal.h"

namespace alidade {

/// Stride along both axes that leaves about ten thousand pixels: enough for six weights and a median to 1 %.
[[nodiscard]] Eigen::Index stride_of(Eigen::Index num_pixels);

/// Smooths with a Gaussian of 1 px, the width of a small spot.
[[nodiscard]] Image smoothed_image(const Image& image);

/// The noise of `detected`: of a pixel, of sums over pixels with correlated noise, the residual of compression, and the
/// residual at edges.
void measure_noise(SpotSignal& signal);

}  // namespace alidade
