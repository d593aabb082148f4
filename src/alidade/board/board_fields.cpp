#include "alidade/board/board_fields.h"

#include "alidade/board/dictionary.h"

namespace alidade {
namespace {

const WordList<BoardKind>& kind_words() {
  static const WordList<BoardKind> words = [] {
    WordList<BoardKind> list;
    for (const BoardKind kind : {BoardKind::chessboard, BoardKind::charuco, BoardKind::aprilgrid, BoardKind::circles,
                                 BoardKind::asymmetric_circles}) {
      list.emplace_back(kind, kind_name(kind));
    }
    return list;
  }();
  return words;
}

TextCode dictionary_code(std::string& name) {
  TextCode code;
  code.read = [&name](const std::string& text) -> std::string {
    if (!marker_dictionary(text)) {
      return "'" + text + "' is not a marker dictionary; known are " + marker_dictionary_names();
    }
    name = text;
    return "";
  };
  code.write = [&name] { return name; };
  return code;
}

constexpr const char* usual_dictionary = "DICT_5X5_100";

}  // namespace

FieldList fields_of(Board& board, bool is_required) {
  const std::string group = "The board";
  return {{.name = "board",
           .value = pair_code(board.cols, board.rows, 1 << 30, "COLSxROWS, for example 9x6"),
           .help = "Inner corners (or circles, tags) per row and per column",
           .form = "COLSxROWS",
           .group = group,
           .is_required = is_required},
          {.name = "square_m",
           .value = length_code(board.square_m, min_square_m, max_square_m),
           .help = "Side of a square, spacing of circles or side of a tag [m], or with unit: 25mm",
           .form = "M",
           .group = group,
           .is_required = is_required},
          {.name = "board_kind",
           .value = words_code(board.kind, kind_words()),
           .help = "Kind of pattern",
           .old_options = {"--target"},
           .group = group},
          {.name = "marker_m",
           .value = length_code(board.marker_m, min_square_m, max_square_m),
           .help = "Side of a marker (charuco), gap between tags (aprilgrid), diameter (circles) [m]",
           .form = "M",
           .group = group},
          {.name = "dictionary",
           .value = dictionary_code(board.dictionary),
           .help = std::string("Marker dictionary of a charuco board (default: ") + usual_dictionary + ")",
           .form = "NAME",
           .group = group}};
}

std::string complete(Board& board) {
  if (board.cols == 0) return "--square needs --board COLSxROWS";
  if (board.square_m == 0.0) return "--board needs --square M";
  const bool needs_marker = board.kind == BoardKind::charuco || board.kind == BoardKind::aprilgrid;
  if (needs_marker && board.marker_m == 0.0) {
    return "--board-kind " + std::string(kind_name(board.kind)) + " needs --marker M";
  }
  if (board.kind == BoardKind::chessboard && board.marker_m != 0.0) return "--marker: a chessboard has none";
  if (board.kind != BoardKind::charuco) board.dictionary.clear();
  if (board.kind == BoardKind::charuco && board.dictionary.empty()) board.dictionary = usual_dictionary;
  const std::string what = fault(board);
  return what.empty() ? "" : "--board: " + what;
}

}  // namespace alidade
