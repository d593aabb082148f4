#pragma once

#include <string>
#include <vector>

#include "alidade/board_detector/find_boards.h"
#include "alidade/calibrate/calibrate.h"

namespace alidade {

/// The way from photos to a camera: what was found in each, and the calibration.
struct PhotoCalibration {
  std::vector<BoardView> views;      ///< One per photo, after the second extraction; no corners where none was found.
  std::vector<std::string> reasons;  ///< One per photo: why it has no corners; empty where it has.
  ImageSize size;                    ///< That most photos have; 0×0 where none could be read.
  std::size_t num_unreadable = 0;
  CalibrateReport report;  ///< Of `views`.
};

/// Bouguet's procedure: find the corners, calibrate a flat board, extract the corners again with lens and pose known,
/// calibrate as `config` asks. Photos of another size than most are rejected and named. Where
/// (nearly) none shows the board as given, the board that they do show is searched, and the report says how to give
/// it. J.-Y. Bouguet, "Camera calibration toolbox for Matlab", first example: analyse error, reproject, recompute
/// corners.
[[nodiscard]] PhotoCalibration calibrate_photos(const std::vector<std::string>& names, const PhotoLoader& load_photo,
                                                const Board& board, const CalibrateConfig& config,
                                                std::span<const Eigen::Vector3d> given_points = {},
                                                const Progress& progress = {});

}  // namespace alidade
