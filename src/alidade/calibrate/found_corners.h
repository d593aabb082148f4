#pragma once

#include "alidade/calibrate/calibration.h"
#include "alidade/imaging/photos.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The corners of a board in photos, each with its total covariance: that of its fit and, where a calibration of the
/// photos converges, the excess that its residuals show.
struct FoundCorners {
  std::vector<BoardView> board_views;  ///< One per photo; without the rejected ones.
  ImageSize size;
  std::size_t num_corners = 0, num_photos = 0;  ///< With corners.
  std::vector<std::string> rejected;            ///< "left.jpg: corner 7", of photos that are used.
  std::size_t num_rejected = 0;                 ///< All of them.
  double sigma_px = 0.0;                        ///< Of one coordinate, the median.
  double excess_px = 0.0;                       ///< Found in the residuals, and added.
  bool has_excess = false;
  Calibration calibration;  ///< Its corners with the excess as well.
  Counts counts;            ///< Of photos.
  Verdict verdict;
};

/// Finds them. `config.outliers` keep: nothing is rejected. Throws as calibrate() does.
[[nodiscard]] FoundCorners find_corners(const Photos& photos, const Board& board, const CalibrateConfig& config = {},
                                        const Progress& progress = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
