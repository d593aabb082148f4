#pragma once

#include <filesystem>

#include "alidade/board/board.h"
#include "alidade/camera/camera.h"

namespace alidade {

/// What later commands need of an earlier `alidade calibrate`.
struct CalibrationResult {
  Camera camera;
  Board board;
  std::vector<Eigen::Vector3d> board_points;  ///< [m] as solved.
  double noise_px = 0.0;                      ///< Of a corner.
  double design_effect = 1.0;                 ///< Variance over that of corners that err independently.
};

/// Reads the folder of a calibration (or the result.json in it). Throws InputError: not a calibration, a refused one,
/// files missing.
[[nodiscard]] CalibrationResult read_calibration(const std::filesystem::path& result);

}  // namespace alidade
