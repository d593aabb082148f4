#pragma once

#include "alidade/board/board.h"
#include "alidade/description/field.h"

namespace alidade {

/// Plausible sizes of squares, markers and gaps of printed boards. [m]
inline constexpr double min_square_m = 5e-4, max_square_m = 2.0;

/// The fields of a board, wherever one is specified: board (columns x rows), square_m, board_kind, marker_m,
/// dictionary. Lengths are in metres, or have a unit; a bare number outside the plausible sizes is rejected, because
/// millimetres were meant. `is_required`: columns, rows and square must be given; otherwise they may be, both or none.
[[nodiscard]] FieldList fields_of(Board& board, bool is_required = true);

/// What is wrong with a board as specified, with the option concerned ("--marker: a chessboard has none"); empty
/// if it is usable. Sets the usual dictionary for a charuco board without one.
[[nodiscard]] std::string complete(Board& board);

}  // namespace alidade
