#pragma once

#include <optional>
#include <string>
#include <vector>

#include "alidade/calibrate/calibrate.h"
#include "alidade/calibrate/shape_transfer.h"
#include "alidade/camera/camera_diff.h"
#include "alidade/estimation/progress.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Mean residual over a cell of the image.
struct ResidualCell {
  double u_px = 0.0, v_px = 0.0;  ///< Centre.
  int count = 0;
  Eigen::Vector2d mean_px = Eigen::Vector2d::Zero();
  double z = 0.0;  ///< |mean| over its σ, √(χ²₂): over 3 it is not noise.
};

/// Mean radial and tangential residual over a ring around the principal point.
struct ResidualRing {
  double radius_px = 0.0;
  int count = 0;
  double mean_radial_px = 0.0, mean_tangential_px = 0.0, sigma_px = 0.0;
};

/// Residuals of photos that took no part in the calibration, with one lens model.
struct HeldOutModel {
  std::string name;
  double heldout_rms_px = 0.0;
  double sigma_px = 0.0;   ///< σ of the difference to the model in use, from photo to photo; its own: 0.
  double gain_px = 0.0;    ///< By how much its error is below that of the model in use.
  bool is_richer = false;  ///< Has terms that the model in use lacks.
};

/// The two halves of the photos (even and odd), calibrated apart.
struct Halves {
  CameraDiff diff;       ///< Second minus first over the image.
  double worst_z = 0.0;  ///< Largest |difference| of a parameter in its σ.
  double limit = 3.0;    ///< What the largest of so many exceeds by chance once in 370: 3.6 of nine.
  std::string worst_name;
};

/// The basis of the verdict on a calibration.
struct CalibrationStudy {
  std::vector<ResidualCell> cells;
  std::vector<ResidualRing> rings;
  PixelGrid sigma_infinity, sigma_working;
  double working_distance_m = 0.0;   ///< Median distance of the boards.
  std::optional<Halves> halves;      ///< None for fewer than six photos.
  std::vector<HeldOutModel> models;  ///< Empty for fewer than six photos.
  std::optional<ShapeTransfer>
      transfer;  ///< Of the shape in use, else of the most informative one; none for few photos.
  /// How the print departs from its grid, where that is proved and would move the lens by more than two of its σ; empty
  /// otherwise. With every point free it is estimated.
  std::string print_error;
  std::string lens_error;   ///< Likewise of the lens, from its model.
  std::string lens_remedy;  ///< What to do about it.
};

/// Residual structure, σ maps, halves and held-out error of other models; `transfer` is passed on. `report` must have
/// converged. Photos beyond a few dozen are sampled where a part would take long; the seconds stay in the order of the
/// calibration's own.
[[nodiscard]] CalibrationStudy study_calibration(const Board& board, std::span<const BoardView> views,
                                                 const CalibrateConfig& config, const CalibrateReport& report,
                                                 std::optional<ShapeTransfer> transfer, const Progress& progress = {});

/// The views that took part, at most `most` of them, evenly chosen, without the corners that were rejected.
[[nodiscard]] std::vector<BoardView> used_views(std::span<const BoardView> views, const CalibrateReport& report,
                                                std::size_t most);

ALIDADE_PUBLIC_END
}  // namespace alidade
