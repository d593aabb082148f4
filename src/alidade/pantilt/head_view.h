#pragma once

#include <string>

#include "alidade/board/board_view.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// A static board, as the camera of one head saw it at one pair of readings.
struct HeadView {
  BoardView seen;  ///< seen.photo: what the view is called ("view 17").
  int board = 0;   ///< Which pose of the board: views of one pose have one number, whatever head saw it.
  int head = 1;    ///< Id of the head.
  Eigen::Vector2d pan_tilt_rad = Eigen::Vector2d::Zero();  ///< What its encoders read.
};

ALIDADE_PUBLIC_END
}  // namespace alidade
