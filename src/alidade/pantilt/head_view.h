#pragma once

#include <span>
#include <string>

#include "alidade/board/board_view.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// A static board observed by the camera of one head, at one pair of encoder readings.
struct HeadView {
  BoardView seen;  ///< seen.photo: the name of the view ("view 17").
  int board = 0;   ///< Number of the board's pose, the same for all views of that pose by any head.
  int head = 1;    ///< Id of the head.
  Eigen::Vector2d pan_tilt_rad = Eigen::Vector2d::Zero();  ///< Encoder readings.
};

ALIDADE_PUBLIC_END

/// The same direction, within half a revolution of `near_rad`. An angle already in that range is returned bit for bit;
/// NaN stays NaN.
[[nodiscard]] double angle_near(double angle_rad, double near_rad);

/// Unwraps a reading of an encoder that may wrap around after a revolution, relative to the previous reading. A reading
/// of more than one revolution comes from an encoder that does not wrap, or is not in radians: it is returned as it is.
[[nodiscard]] double reading_after(double reading_rad, double last_rad);

/// Undoes the wrap-around of encoders: the readings of each axis of each head become those of one continuous arc around
/// zero. Only where they lie on both sides of the wrap, with a far wider gap in between, and cover no more than one
/// revolution.
void unwrap_readings(std::span<HeadView> views);
}  // namespace alidade
