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

/// Mean residual in one cell of the image.
struct ResidualCell {
  double u_px = 0.0, v_px = 0.0;  ///< Centre of the cell.
  int count = 0;
  Eigen::Vector2d mean_px = Eigen::Vector2d::Zero();
  double z = 0.0;  ///< |mean| over its σ, √(χ²₂): above 3 it is not noise.
};

/// Mean radial and tangential residual in a ring around the principal point.
struct ResidualRing {
  double radius_px = 0.0;
  int count = 0;
  double mean_radial_px = 0.0, mean_tangential_px = 0.0, sigma_px = 0.0;
};

/// Residuals of photos that were held out of the calibration, for one lens model.
struct HeldOutModel {
  std::string name;
  double heldout_rms_px = 0.0;
  double sigma_px = 0.0;   ///< σ of gain_px, from the scatter between photos; 0 for the model in use.
  double gain_px = 0.0;    ///< By how much its RMS is below that of the model in use.
  bool is_richer = false;  ///< Has terms that the model in use lacks.
};

/// The two halves of the photos (even and odd), calibrated independently.
struct Halves {
  CameraDiff diff;       ///< Second minus first over the image.
  double worst_z = 0.0;  ///< Largest |difference| of a parameter over its σ.
  double limit = 3.0;    ///< Exceeded by chance once in 370 by the largest of all parameters: 3.6 for nine.
  std::string worst_name;
};

/// The basis of the verdict on a calibration.
struct CalibrationStudy {
  std::vector<ResidualCell> cells;
  std::vector<ResidualRing> rings;
  PixelGrid sigma_infinity, sigma_working;
  double working_distance_m = 0.0;   ///< Median distance of the boards.
  std::optional<Halves> halves;      ///< Empty for fewer than six photos.
  std::vector<HeldOutModel> models;  ///< Empty for fewer than six photos.
  std::optional<ShapeTransfer>
      transfer;  ///< Test of the shape in use, else of the one that predicts best; none for too few photos.
  /// How the print departs from its grid, where this is significant and would move the lens by more than two of its σ;
  /// empty otherwise. With every point free it is estimated.
  std::string print_error;
  std::string lens_error;   ///< The same for the lens: how it departs from its model.
  std::string lens_remedy;  ///< What to do about it.
};

/// Residual structure, σ maps, halves and held-out error of other models; `transfer` is passed through. `report` must
/// have converged. If there are more than a few dozen photos, slow parts use a sample of them; the run time stays in
/// the order of the calibration's own.
[[nodiscard]] CalibrationStudy study_calibration(const Board& board, std::span<const BoardView> views,
                                                 const CalibrateConfig& config, const CalibrateReport& report,
                                                 std::optional<ShapeTransfer> transfer, const Progress& progress = {});

/// The used views, at most `most` of them, evenly spaced, without the rejected corners.
[[nodiscard]] std::vector<BoardView> used_views(std::span<const BoardView> views, const CalibrateReport& report,
                                                std::size_t most);

ALIDADE_PUBLIC_END
}  // namespace alidade
