#pragma once

#include <span>
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

/// The same direction within half a turn of another. An angle that is there already stays as it is, to the last digit;
/// NaN stays NaN.
[[nodiscard]] double angle_near(double angle_rad, double near_rad);

/// What an encoder reads that may begin again after a turn, as it goes on from what it read last. A reading of more
/// than a turn is of one that does not, or is no radian: it stays.
[[nodiscard]] double reading_after(double reading_rad, double last_rad);

/// Undoes what encoders do that begin again after a turn: of each axis of each head the readings become those of one
/// arc, about zero. Only where they lie on both sides of the turn's end, with a far wider gap inside, and cover no more
/// than a turn.
void unwrap_readings(std::span<HeadView> views);
}  // namespace alidade
