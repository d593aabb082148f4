#pragma once

#include "alidade/calibrate/calibration.h"
#include "alidade/imaging/photos.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The corners of a board in photos, each with its total covariance: that of the corner fit and, if a calibration from
/// the photos converges, the excess noise estimated from its residuals.
struct FoundCorners {
  std::vector<BoardView> board_views;  ///< One per photo; without the rejected corners.
  ImageSize size;
  std::size_t num_corners = 0, num_photos = 0;  ///< Accepted corners, and photos that have any.
  std::vector<std::string> rejected;            ///< "left.jpg: corner 7"; only for photos that are used.
  std::size_t num_rejected = 0;                 ///< Including corners of photos that are not used.
  double sigma_px = 0.0;                        ///< σ of one coordinate, median over the corners.
  double excess_px = 0.0;                       ///< σ estimated from the residuals and added, per coordinate.
  bool has_excess = false;
  Calibration calibration;  ///< Its corners include the excess as well.
  Counts counts;            ///< Number of photos.
  Verdict verdict;
};

/// Finds the corners. With `config.outliers` keep, nothing is rejected. Throws as calibrate() does.
[[nodiscard]] FoundCorners find_corners(const Photos& photos, const Board& board, const CalibrateConfig& config = {},
                                        const Progress& progress = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
