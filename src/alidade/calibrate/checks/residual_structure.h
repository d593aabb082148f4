#pragma once

#include <span>
#include <vector>

#include "alidade/calibrate/study.h"

namespace alidade {

/// Mean residual per cell of a cols × rows division of the image.
[[nodiscard]] std::vector<ResidualCell> residual_cells(std::span<const BoardView> views, const CalibrateReport& report,
                                                       int cols, int rows);

/// Mean radial and tangential residual per ring of equal width around the principal point.
[[nodiscard]] std::vector<ResidualRing> residual_rings(std::span<const BoardView> views, const CalibrateReport& report,
                                                       int num_rings);

}  // namespace alidade
