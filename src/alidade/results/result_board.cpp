#include "alidade/results/result_board.h"

#include <nlohmann/json.hpp>

#include "alidade/files/files.h"

namespace alidade {

Board result_board(const std::string& text) {
  const auto json = nlohmann::json::parse(text);
  Board board;
  const auto kind = board_kind(json.value("kind", "chessboard"));
  if (!kind) throw InputError("estimate.board.kind is not a kind of board");
  board.kind = *kind;
  const double cols = json.at("cols").get<double>(), rows = json.at("rows").get<double>();
  board.square_m = json.at("square_m").get<double>();
  board.marker_m = json.value("marker_m", 0.0);
  constexpr double most = 1000.0;
  const bool sane = cols >= 1.0 && rows >= 1.0 && cols <= most && rows <= most && board.square_m > 0.0;
  if (!sane) throw InputError("estimate.board is not a board");
  board.cols = static_cast<int>(cols);
  board.rows = static_cast<int>(rows);
  return board;
}

}  // namespace alidade
