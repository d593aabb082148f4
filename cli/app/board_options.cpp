#include "cli/app/board_options.h"

#include <CLI/CLI.hpp>

#include "alidade/board/board_fields.h"
#include "cli/app/field_options.h"
#include "cli/app/run.h"

namespace alidade::cli {

Board no_board() { return {.cols = 0, .rows = 0, .square_m = 0.0, .dictionary = ""}; }

void add_board_options(CLI::App& command, Board& board, bool is_required) {
  add_fields(command, fields_of(board, is_required));
  for (const char* name : {"--board", "--square"}) command.get_option(name)->required(is_required);
}

void require_board(Board& board) {
  if (const std::string fault = complete(board); !fault.empty()) throw UsageError(fault);
}

}  // namespace alidade::cli
