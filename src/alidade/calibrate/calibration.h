#pragma once

#include <optional>
#include <vector>

#include "alidade/board/board_view.h"
#include "alidade/calibrate/calibrate.h"
#include "alidade/calibrate/next_photo.h"
#include "alidade/calibrate/study.h"
#include "alidade/camera/port_residual.h"
#include "alidade/estimation/counts.h"
#include "alidade/estimation/verdict.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The result of calibrate(): the estimate (camera, views, board_points …), the study of its quality, and the verdict.
/// `study` and `next` are empty where no camera could be estimated.
struct Calibration : CalibrateReport {
  Board board;
  std::vector<BoardView> board_views;  ///< The corners, one entry per photo; for their use see `views`.
  ImageSize size;                      ///< Size of most photos; 0x0 if none could be read.
  std::size_t num_unreadable = 0;      ///< Photos that could not be read.
  CalibrateConfig config;              ///< As used: without a board shape that failed its transfer test.
  BoardShape asked_shape = BoardShape::automatic;
  CalibrationStudy study;
  NextPhotoPlan next;
  std::optional<PortResidual> port;  ///< Model flat_port: whether a brown lens would suffice.
  std::vector<Assumption> assumed;
  Counts counts;  ///< Number of photos.
  Verdict verdict;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
