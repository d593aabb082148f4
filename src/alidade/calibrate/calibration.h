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

/// The result of calibrate(): what the solve found (camera, views, board_points …), its study and its verdict.
/// `study` and `next` are empty where there is no camera.
struct Calibration : CalibrateReport {
  Board board;
  std::vector<BoardView> board_views;  ///< The corners, one entry per photo; `views` says what became of each.
  ImageSize size;                      ///< Of most photos; 0x0 where none could be read.
  std::size_t num_unreadable = 0;      ///< Photos that could not be read.
  CalibrateConfig config;              ///< As used: without a board shape that failed its transfer test.
  BoardShape asked_shape = BoardShape::automatic;
  CalibrationStudy study;
  NextPhotoPlan next;
  std::optional<PortResidual> port;  ///< Of a flat_port: whether a brown lens would suffice.
  std::vector<Assumption> assumed;
  Counts counts;  ///< Of photos.
  Verdict verdict;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
