#pragma once

#include "alidade/board/board.h"

namespace CLI {
class App;
}

namespace alidade::cli {

/// A board of which nothing has been given yet.
[[nodiscard]] Board no_board();

[[nodiscard]] inline bool is_given(const Board& board) { return board.cols > 0 || board.square_m > 0.0; }

/// The options of fields_of(Board&): for commands whose other options are not described by fields.
void add_board_options(CLI::App& command, Board& board, bool is_required = true);

/// Throws UsageError where the options describe no board; takes the usual dictionary for a charuco board without one.
void require_board(Board& board);

}  // namespace alidade::cli
