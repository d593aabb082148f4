#include "cli/board_options.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>
#include <utility>

#include "alidade/board/dictionary.h"
#include "cli/option_checks.h"
#include "cli/run.h"

namespace alidade::cli {
namespace {

/// Columns and rows of "9x6".
std::optional<std::pair<int, int>> cols_and_rows(const std::string& text) {
  const char *at = text.data(), *end = at + text.size();
  int cols = 0, rows = 0;
  const auto left = std::from_chars(at, end, cols);
  if (left.ec != std::errc{} || left.ptr == end || (*left.ptr != 'x' && *left.ptr != 'X')) return std::nullopt;
  const auto right = std::from_chars(left.ptr + 1, end, rows);
  if (right.ec != std::errc{} || right.ptr != end || cols <= 0 || rows <= 0) return std::nullopt;
  return std::pair{cols, rows};
}

CLI::Validator size_check() {
  return {[](const std::string& text) -> std::string {
            return cols_and_rows(text) ? "" : "'" + text + "' is not COLSxROWS, for example 9x6";
          },
          ""};
}

/// A length in metres, or with its unit: "25mm" becomes 0.025. A bare number that no board has was meant in another
/// unit.
CLI::Validator length() {
  return {[](std::string& text) -> std::string {
            double value = 0.0;
            const char* const end = text.data() + text.size();
            const auto [rest, error] = std::from_chars(text.data(), end, value);
            const std::string_view unit(rest, static_cast<std::size_t>(end - rest));
            const double metres = unit == "mm" ? 1e-3 : unit == "cm" ? 1e-2 : unit == "m" ? 1.0 : 0.0;
            if (error == std::errc{} && std::isfinite(value) && value > 0.0 && metres > 0.0) {
              text = fmt::format("{}", value * metres);
              return "";
            }
            if (const std::string fault = positive_number()(text); !fault.empty()) return fault;
            constexpr double largest_m = 2.0, smallest_m = 5e-4;
            if (value > largest_m) {
              return fmt::format("'{0}' is in metres: {1:g}? Or with its unit, {0}mm or {0}m", text, 1e-3 * value);
            }
            if (value < smallest_m) {
              return fmt::format("'{}' is in metres, {:g} mm: if that is meant, with its unit, {:g}mm", text,
                                 1e3 * value, 1e3 * value);
            }
            return "";
          },
          ""};
}

CLI::Validator target_check() {
  return {[](const std::string& text) -> std::string {
            if (board_kind(text)) return "";
            return "'" + text + "' is not one of chessboard, charuco, aprilgrid, circles, asymmetric_circles";
          },
          ""};
}

CLI::Validator dictionary_check() {
  return {[](const std::string& text) -> std::string {
            if (marker_dictionary(text)) return "";
            return "'" + text + "' is not a marker dictionary; known are " + marker_dictionary_names();
          },
          ""};
}

}  // namespace

void add_board_options(CLI::App& command, BoardOptions& options, bool is_required) {
  const std::string group = "The board";
  CLI::Option* size = command.add_option("--board", options.size, "Inner corners (circles, tags) along and across")
                          ->type_name("COLSxROWS")
                          ->check(size_check())
                          ->required(is_required)
                          ->group(group);
  CLI::Option* square =
      command
          .add_option("--square", options.square_m, "Side of a square, distance of circles, side of a tag [m], or 25mm")
          ->type_name("M")
          ->transform(length())
          ->required(is_required)
          ->group(group);
  size->needs(square);
  square->needs(size);
  command.add_option("--target", options.target, "chessboard, charuco, aprilgrid, circles or asymmetric_circles")
      ->type_name("KIND")
      ->check(target_check())
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--marker", options.marker_m,
                  "Side of a marker (charuco), gap between tags (aprilgrid), diameter (circles) [m]")
      ->type_name("M")
      ->transform(length())
      ->group(group);
  command.add_option("--dictionary", options.dictionary, "Marker dictionary of a charuco board")
      ->type_name("NAME")
      ->check(dictionary_check())
      ->capture_default_str()
      ->group(group);
}

Board board_from(const BoardOptions& options) {
  Board board;
  board.kind = board_kind(options.target).value_or(BoardKind::chessboard);
  const auto size = cols_and_rows(options.size);
  if (!size) throw UsageError("--board: '" + options.size + "' is not COLSxROWS, for example 9x6");
  std::tie(board.cols, board.rows) = *size;
  board.square_m = options.square_m;
  board.marker_m = options.marker_m;
  const bool needs_marker = board.kind == BoardKind::charuco || board.kind == BoardKind::aprilgrid;
  if (needs_marker && board.marker_m == 0.0) throw UsageError("--target " + options.target + " needs --marker M");
  if (board.kind == BoardKind::chessboard && board.marker_m != 0.0) throw UsageError("--marker: a chessboard has none");
  if (board.kind == BoardKind::charuco) board.dictionary = options.dictionary;
  const std::string what = fault(board);
  if (!what.empty()) throw UsageError("--board: " + what);
  return board;
}

}  // namespace alidade::cli
