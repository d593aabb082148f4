#pragma once

#include <string>
#include <vector>

#include "alidade/board_detector/find_boards.h"
#include "alidade/calibrate/calibrate.h"

namespace alidade {

/// From photos to a camera: the detections in each photo, and the calibration.
struct PhotoCalibration {
  std::vector<BoardView> views;  ///< One per photo, after the second extraction; without corners if none were found.
  std::vector<std::string> reasons;  ///< One per photo: why it has no corners; empty if it has.
  ImageSize size;                    ///< Size of most photos; 0×0 if none could be read.
  std::size_t num_unreadable = 0;
  CalibrateReport report;  ///< From `views`.
};

/// Bouguet's procedure: detect the corners, calibrate with a flat board, extract the corners again with lens and pose
/// known, calibrate as `config` asks. Photos of another size than most are rejected and named. If
/// (nearly) none shows the given board, the board that they do show is searched for, and the report says how to specify
/// it. J.-Y. Bouguet, "Camera calibration toolbox for Matlab", first example: analyse error, reproject, recompute
/// corners.
[[nodiscard]] PhotoCalibration calibrate_photos(const std::vector<std::string>& names, const PhotoLoader& load_photo,
                                                const Board& board, const CalibrateConfig& config,
                                                std::span<const Eigen::Vector3d> given_points = {},
                                                const Progress& progress = {});

}  // namespace alidade
