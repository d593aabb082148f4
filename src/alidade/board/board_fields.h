#pragma once

#include "alidade/board/board.h"
#include "alidade/description/field.h"

namespace alidade {

/// Squares, markers and gaps of boards that are printed. [m]
inline constexpr double min_square_m = 5e-4, max_square_m = 2.0;

/// The fields of a board, wherever one is given: board (columns x rows), square_m, board_kind, marker_m, dictionary.
/// Lengths are metres, or have their unit; a bare number that no printed board has is refused, as millimetres were
/// meant. `is_required`: columns, rows and square must be given; else they may be, both or none.
[[nodiscard]] FieldList fields_of(Board& board, bool is_required = true);

/// What is wrong with a board as it was given, with the option that says it ("--marker: a chessboard has none"); empty
/// where it is usable. Takes the usual dictionary for a charuco board without one.
[[nodiscard]] std::string complete(Board& board);

}  // namespace alidade
