#pragma once

#include "alidade/calibrate/assumed.h"
#include "alidade/calibrate/calibrate_photos.h"
#include "alidade/calibrate/next_photo.h"
#include "alidade/calibrate/port.h"
#include "alidade/calibrate/study.h"
#include "alidade/estimation/verdict.h"

namespace alidade {

/// Everything `alidade calibrate` has to say. `study` and `next` are empty where there is no camera.
struct Calibration {
  PhotoCalibration photos;
  CalibrateConfig config;  ///< As used: a shape that does not transfer is not used.
  BoardShape asked_shape = BoardShape::automatic;
  CalibrationStudy study;
  NextPhotoPlan next;
  std::optional<PortResidual> port;  ///< Of a flat_port: whether a brown lens would do.
  std::vector<Assumption> assumed;
  Verdict verdict;
};

/// Judges a finished solve: studies it, plans the next photo and gives the verdict. A board shape that was asked for
/// but does not transfer from one half of the photos to the other is dropped (`decide_shape`), and the board solved
/// flat or as a bow; with BoardShape::automatic the transfer test decides. `air`: the lens that `config` holds
/// (flat_port), whose covariance is then counted.
[[nodiscard]] Calibration judge_calibration(const Board& board, PhotoCalibration photos, CalibrateConfig config,
                                            const std::optional<Camera>& air = {}, const Progress& progress = {});

}  // namespace alidade
