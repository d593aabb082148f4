#pragma once

#include <string>

#include "alidade/board/board.h"

namespace CLI {
class App;
}

namespace alidade::cli {

/// The flags that describe a board, the same for every command that reads or makes photos of one.
struct BoardOptions {
  std::string target = "chessboard";
  std::string size;       ///< "9x6"
  double square_m = 0.0;  ///< 0: not given.
  double marker_m = 0.0;  ///< 0: not given.
  std::string dictionary = "DICT_5X5_100";
};

/// Adds --board, --square, --target, --marker and --dictionary. Lengths are metres, or have their unit (25mm); a bare
/// number above 2 or below 0.0005 is refused, as no printed board has such squares. Where a board is not required,
/// --board needs --square and the other way round.
void add_board_options(CLI::App& command, BoardOptions& options, bool is_required = true);

/// The board that the flags describe. Throws UsageError where there is none.
[[nodiscard]] Board board_from(const BoardOptions& options);

}  // namespace alidade::cli
