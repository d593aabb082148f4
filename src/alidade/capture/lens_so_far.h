#pragma once

#include <string>
#include <vector>

#include "alidade/board/board_view.h"
#include "alidade/calibrate/calibrate.h"

namespace alidade {

/// The camera from a few photos: a solve where they determine one; else a guess with a weak prior and the information
/// of these photos, so that the next pose can be chosen from the first photo on.
struct LensSoFar {
  Camera camera;  ///< With its covariance.
  bool is_solved = false;
  double noise_px = 0.3;                      ///< What one more photo is worth.
  std::vector<Eigen::Vector3d> board_points;  ///< [m]
  CalibrateReport report;                     ///< Of the solve.
};

/// `config` as calibrate() takes it, resolved; the board's shape is not solved for.
[[nodiscard]] LensSoFar lens_so_far(const Board& board, const std::vector<BoardView>& views, const ImageSize& size,
                                    const CalibrateConfig& config);

/// "the focal length varies between photos, …" where the focal lengths of single photos differ from those of their
/// neighbours, far beyond their σ: a camera that focuses by itself. Empty where none does.
[[nodiscard]] std::string focal_walk(const LensSoFar& lens, const std::vector<BoardView>& views);

}  // namespace alidade
