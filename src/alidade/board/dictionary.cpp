#include "alidade/board/dictionary.h"

#include <fmt/format.h>

#include <array>
#include <cmath>

namespace alidade {
namespace {

struct Entry {
  std::string_view name;
  int num_markers;
};

// In the order of OpenCV's PREDEFINED_DICTIONARY_NAME.
constexpr std::array<Entry, 21> entries{
    {{"DICT_4X4_50", 50},        {"DICT_4X4_100", 100},         {"DICT_4X4_250", 250},
     {"DICT_4X4_1000", 1000},    {"DICT_5X5_50", 50},           {"DICT_5X5_100", 100},
     {"DICT_5X5_250", 250},      {"DICT_5X5_1000", 1000},       {"DICT_6X6_50", 50},
     {"DICT_6X6_100", 100},      {"DICT_6X6_250", 250},         {"DICT_6X6_1000", 1000},
     {"DICT_7X7_50", 50},        {"DICT_7X7_100", 100},         {"DICT_7X7_250", 250},
     {"DICT_7X7_1000", 1000},    {"DICT_ARUCO_ORIGINAL", 1024}, {"DICT_APRILTAG_16h5", 30},
     {"DICT_APRILTAG_25h9", 35}, {"DICT_APRILTAG_36h10", 2320}, {"DICT_APRILTAG_36h11", 587}}};

std::string charuco_fault(const Board& board) {
  const auto dictionary = marker_dictionary(board.dictionary);
  if (!dictionary) {
    return "'" + board.dictionary + "' is not a marker dictionary; known are " + marker_dictionary_names();
  }
  if (!(board.marker_m > 0.0 && board.marker_m < board.square_m)) {
    return "the markers of a charuco board are larger than 0 and smaller than its squares";
  }
  const int needed = (board.cols + 1) * (board.rows + 1) / 2;
  if (needed > dictionary->num_markers) {
    return "the board needs " + std::to_string(needed) + " markers, " + board.dictionary + " has " +
           std::to_string(dictionary->num_markers);
  }
  return {};
}

std::string aprilgrid_fault(const Board& board) {
  if (!(board.marker_m > 0.0 && board.marker_m < board.square_m)) {
    return "the gap between tags is larger than 0 and smaller than a tag";
  }
  const int available = marker_dictionary("DICT_APRILTAG_36h11")->num_markers;
  if (board.cols * board.rows <= available) return {};
  return "the board needs " + std::to_string(board.cols * board.rows) + " tags, tag36h11 has " +
         std::to_string(available);
}

std::string circles_fault(const Board& board) {
  const double nearest_m = board.kind == BoardKind::circles ? board.square_m : std::sqrt(2.0) * board.square_m;
  return circle_radius_m(board) > 0.0 && 2.0 * circle_radius_m(board) < nearest_m ? "" : "the circles touch each other";
}

}  // namespace

std::optional<MarkerDictionary> marker_dictionary(std::string_view name) {
  for (std::size_t i = 0; i < entries.size(); ++i) {
    if (entries[i].name == name) return MarkerDictionary{static_cast<int>(i), entries[i].num_markers};
  }
  return std::nullopt;
}

std::string marker_dictionary_names() {
  std::string names;
  for (const Entry& entry : entries) names += (names.empty() ? "" : ", ") + std::string(entry.name);
  return names;
}

std::string fault(const Board& board) {
  constexpr int most = 200;  // more is a typing error, and would take hours to search
  const int least = board.kind == BoardKind::aprilgrid ? 1 : 2;
  if (board.cols < least || board.rows < least || board.cols > most || board.rows > most) {
    return "a board has " + std::to_string(least) + " to " + std::to_string(most) + " columns and rows, not " +
           std::to_string(board.cols) + "x" + std::to_string(board.rows);
  }
  if (!(std::isfinite(board.square_m) && board.square_m > 0.0)) return "the pitch of a board is larger than 0";
  constexpr double min_m = 1e-9, max_m = 1e6;  // millimetres or micrometres that are taken for metres: no fault yet
  if (board.square_m < min_m || board.square_m > max_m)
    return fmt::format("the pitch of a board is in metres, and not {:.3g}", board.square_m);
  switch (board.kind) {
    case BoardKind::chessboard:
      return {};
    case BoardKind::charuco:
      return charuco_fault(board);
    case BoardKind::aprilgrid:
      return aprilgrid_fault(board);
    case BoardKind::circles:
    case BoardKind::asymmetric_circles:
      return circles_fault(board);
  }
  return {};
}

}  // namespace alidade
