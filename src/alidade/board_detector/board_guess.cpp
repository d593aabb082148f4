#include "alidade/board_detector/board_guess.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <compare>
#include <cstdio>
#include <opencv2/imgproc.hpp>
#include <tuple>

#include "alidade/board/dictionary.h"
#include "alidade/board_detector/kinds/marker_board.h"
#include "alidade/imaging/grey_photo.h"

namespace alidade {
namespace {

constexpr std::size_t max_photos = 4;

bool has_markers(const Board& board) { return board.kind == BoardKind::charuco || board.kind == BoardKind::aprilgrid; }

using Sizes = std::vector<std::pair<int, int>>;

/// Columns and rows of common mistakes. A chessboard is the same one rotated by a quarter: of two that are equally near
/// to what was given the wide one comes first.
Sizes slips(const Board& given) {
  const int c = given.cols, r = given.rows;
  const Sizes all{{c, r},     {c - 1, r - 1}, {c + 1, r + 1}, {r, c},         {c, r - 1},     {c + 1, r},
                  {c - 1, r}, {c, r + 1},     {c + 1, r - 1}, {c - 1, r + 1}, {r - 1, c - 1}, {r + 1, c + 1}};
  Sizes each;
  for (const auto& size : all) {
    if (std::find(each.begin(), each.end(), size) == each.end()) each.push_back(size);
  }
  return each;
}

/// A few of the photos, evenly chosen, in a size that is searched quickly.
std::vector<cv::Mat> chosen_photos(std::size_t num_photos, const PhotoLoader& load_photo) {
  constexpr double enough_pixels = 2.5e6;
  const std::size_t count = std::min(num_photos, max_photos);
  std::vector<cv::Mat> photos;
  for (std::size_t i = 0; i < count; ++i) {
    cv::Mat photo = load_photo(i * num_photos / count);
    while (static_cast<double>(photo.total()) > enough_pixels) cv::resize(photo, photo, {}, 0.5, 0.5, cv::INTER_AREA);
    photos.push_back(std::move(photo));
  }
  return photos;
}

/// "DICT_5X5" of DICT_5X5_100: dictionaries of one family begin with the same markers. AprilTags have none but
/// themselves.
std::string family(const std::string& dictionary) {
  return dictionary.starts_with("DICT_APRILTAG") ? dictionary : dictionary.substr(0, dictionary.rfind('_'));
}

/// The largest of each family: whatever the board is printed with is in it.
constexpr std::array<const char*, 9> families{"DICT_4X4_1000",      "DICT_5X5_1000",       "DICT_6X6_1000",
                                              "DICT_7X7_1000",      "DICT_ARUCO_ORIGINAL", "DICT_APRILTAG_16h5",
                                              "DICT_APRILTAG_25h9", "DICT_APRILTAG_36h10", "DICT_APRILTAG_36h11"};

/// The dictionary of which most markers are seen; empty where there are next to none.
std::string seen_dictionary(const std::vector<cv::Mat>& photos) {
  constexpr std::size_t min_markers = 4;
  std::vector<std::size_t> counts(families.size(), 0);
  for (const cv::Mat& photo : photos) {
    std::string reason;
    const cv::Mat grey = to_grey_photo(photo, reason);
    for (std::size_t k = 0; reason.empty() && k < families.size(); ++k) counts[k] += count_markers(grey, families[k]);
  }
  const auto most = std::max_element(counts.begin(), counts.end());
  return *most < min_markers ? "" : families[static_cast<std::size_t>(most - counts.begin())];
}

/// The smallest dictionary of a family that holds the board; the given one where it does.
std::string fitting_dictionary(Board board, const std::string& of_family, const std::string& given) {
  board.dictionary = given;
  if (family(given) == family(of_family) && fault(board).empty()) return given;
  for (const std::string ending : {"_50", "_100", "_250", "_1000"}) {
    board.dictionary = family(of_family) + ending;
    if (marker_dictionary(board.dictionary) && fault(board).empty()) return board.dictionary;
  }
  return of_family;
}

/// The kinds of board that may be meant: the given one, then a chessboard with markers for one without.
std::vector<Board> kinds_to_try(const Board& given, const std::string& dictionary) {
  std::vector<Board> kinds;
  const bool is_aprilgrid = given.kind == BoardKind::chessboard && dictionary == "DICT_APRILTAG_36h11";
  const bool is_marked = !dictionary.empty() && !is_aprilgrid;
  if (given.kind != BoardKind::charuco || is_marked) kinds.push_back(given);
  if (given.kind == BoardKind::chessboard && is_marked) {
    kinds.push_back(given);
    kinds.back().kind = BoardKind::charuco;
    kinds.back().marker_m = 0.75 * given.square_m;  // any value: it must be given
  }
  if (given.kind == BoardKind::charuco) {
    Board plain = given;
    plain.kind = BoardKind::chessboard;
    plain.marker_m = 0.0;
    plain.dictionary.clear();
    kinds.push_back(plain);
  }
  return kinds;
}

/// How well a board explains the photos: in how many it is found, then how many of its points are seen.
struct Score {
  std::size_t photos = 0, points = 0;
  auto operator<=>(const Score&) const = default;
};

/// Does some photo show half of each outer row and column? A board given too large has its markers where the
/// right one has them, and one row more, where the paper's border occasionally gives a point.
bool reaches_its_edges(const Board& board, const std::vector<BoardDetection>& photos) {
  std::array<int, 4> most{};
  for (const BoardDetection& photo : photos) {
    std::array<int, 4> seen{};
    for (const Corner& corner : photo.view.corners) {
      const int col = corner.index % board.cols, row = corner.index / board.cols;
      const std::array<bool, 4> is_at{row == 0, row == board.rows - 1, col == 0, col == board.cols - 1};
      for (std::size_t k = 0; k < 4; ++k) seen[k] += is_at[k] ? 1 : 0;
    }
    for (std::size_t k = 0; k < 4; ++k) most[k] = std::max(most[k], seen[k]);
  }
  return 2 * std::min(most[0], most[1]) >= board.cols && 2 * std::min(most[2], most[3]) >= board.rows;
}

Score score_of(const std::vector<cv::Mat>& photos, const Board& board, const Progress& progress) {
  Score score;
  const auto all = static_cast<std::size_t>(num_points(board));
  const PhotoLoader load = [&](std::size_t i) { return photos[i]; };
  const std::vector<BoardDetection> found = find_boards(photos.size(), load, board, false, progress).photos;
  if (board.kind == BoardKind::charuco && !reaches_its_edges(board, found)) return score;
  for (const BoardDetection& photo : found) {
    const std::size_t seen = photo.view.corners.size();
    // Part of a board without markers may be part of another one as well.
    if (has_markers(board) ? 2 * seen < all : seen < all) continue;
    ++score.photos;
    score.points += seen;
  }
  return score;
}

/// Where many photos show a whole grid of another size: the sentence for it; empty otherwise.
std::string other_grid(std::span<const std::string> reasons, std::size_t num_found) {
  std::size_t others = 0;
  std::string example;
  for (const std::string& reason : reasons) {
    if (!reason.starts_with("a grid of ")) continue;
    ++others;
    example = reason;
  }
  if (others < 2 || 3 * others < num_found) return "";
  return std::to_string(others) + " photos show " + example;
}

/// Sizes of the grids that photos of a chessboard show instead of it, as columns and rows: "a grid of 8×6 corners, not
/// 9×6", "only 8×6 of 9×6 corners, …". None where the board is of another kind.
std::optional<Sizes> grids_seen_in(std::span<const std::string> reasons, const Board& given) {
  if (given.kind != BoardKind::chessboard) return std::nullopt;
  constexpr std::ptrdiff_t min_photos = 2;
  constexpr std::size_t max_sizes = 4;
  Sizes all, seen;
  for (const std::string& reason : reasons) {
    std::pair<int, int> size;
    if (std::sscanf(reason.c_str(), "a grid of %d×%d", &size.first, &size.second) != 2 &&
        std::sscanf(reason.c_str(), "only %d×%d of", &size.first, &size.second) != 2)
      continue;
    all.push_back(size);
  }
  const std::ptrdiff_t needed = all.size() < 3 ? 1 : min_photos;
  for (const auto& size : all) {
    if (std::count(all.begin(), all.end(), size) < needed || seen.size() == max_sizes) continue;
    if (std::find(seen.begin(), seen.end(), size) == seen.end()) seen.push_back(size);
  }
  return seen;
}

}  // namespace

std::optional<Board> guess_board(std::size_t num_photos, const PhotoLoader& load_photo, const Board& given,
                                 const std::optional<std::vector<std::pair<int, int>>>& grids_seen,
                                 const Progress& progress) {
  const std::vector<cv::Mat> photos = chosen_photos(num_photos, load_photo);
  if (photos.empty()) return std::nullopt;
  const bool may_have_markers = given.kind == BoardKind::charuco || given.kind == BoardKind::chessboard;
  const std::string dictionary = may_have_markers ? seen_dictionary(photos) : "";
  std::optional<Board> best;
  Score best_score;
  for (Board board : kinds_to_try(given, dictionary)) {
    const bool is_plain = board.kind == BoardKind::chessboard;
    for (const auto& [cols, rows] : is_plain&& grids_seen ? *grids_seen : slips(given)) {
      board.cols = cols;
      board.rows = rows;
      if (board.kind == BoardKind::charuco) board.dictionary = fitting_dictionary(board, dictionary, given.dictionary);
      if (board == given || !fault(board).empty()) continue;
      const Score score = score_of(photos, board, progress);
      if (2 * score.photos <= photos.size()) continue;
      const bool is_smaller = best && score == best_score && num_points(board) < num_points(*best);
      if (best && !(score > best_score) && !is_smaller) continue;
      best = board;
      best_score = score;
    }
  }
  return best;
}

std::optional<WrongBoard> wrong_board(std::span<const std::string> reasons, std::size_t num_found,
                                      std::span<const std::size_t> in_vain, const PhotoLoader& load_photo,
                                      const Board& given, const Progress& progress) {
  const std::string grid = other_grid(reasons, num_found);
  if (in_vain.empty() || (grid.empty() && 3 * num_found > in_vain.size())) return std::nullopt;
  const auto load = [&](std::size_t i) { return load_photo(in_vain[i]); };
  if (const auto meant = guess_board(in_vain.size(), load, given, grids_seen_in(reasons, given), progress)) {
    const std::string with = given.dictionary.empty() ? "" : " with " + given.dictionary;
    return WrongBoard{"the photos do not show the board as given, " + std::to_string(given.cols) + "×" +
                          std::to_string(given.rows) + with,
                      "use " + changed_options(given, *meant) + ": they show that board"};
  }
  if (grid.empty()) return std::nullopt;
  return WrongBoard{grid, "check --board, which counts inner corners"};
}

std::string changed_options(const Board& given, const Board& meant) {
  std::string options;
  const auto add = [&](const std::string& option) { options += (options.empty() ? "" : " ") + option; };
  if (meant.kind != given.kind) add("--board-kind " + std::string(kind_name(meant.kind)));
  if (meant.cols != given.cols || meant.rows != given.rows) {
    add("--board " + std::to_string(meant.cols) + "x" + std::to_string(meant.rows));
  }
  if (meant.kind == BoardKind::charuco && meant.dictionary != given.dictionary) add("--dictionary " + meant.dictionary);
  if (meant.kind == BoardKind::charuco && given.kind != BoardKind::charuco) add("--marker with its markers' side");
  return options;
}

std::optional<WrongBoard> smaller_board(std::span<const BoardView> views, const Board& given) {
  constexpr std::size_t enough = 5;
  if (given.kind != BoardKind::chessboard) return std::nullopt;
  std::optional<std::pair<int, int>> grid;
  std::size_t num = 0;
  for (const BoardView& view : views) {
    if (view.corners.empty()) continue;
    int first_col = given.cols, last_col = 0, first_row = given.rows, last_row = 0;
    for (const Corner& corner : view.corners) {
      first_col = std::min(first_col, corner.index % given.cols);
      last_col = std::max(last_col, corner.index % given.cols);
      first_row = std::min(first_row, corner.index / given.cols);
      last_row = std::max(last_row, corner.index / given.cols);
    }
    const std::pair seen(last_col - first_col + 1, last_row - first_row + 1);
    const bool is_whole = static_cast<int>(view.corners.size()) == seen.first * seen.second;
    if (!is_whole || (grid && *grid != seen)) return std::nullopt;
    grid = seen;
    ++num;
  }
  if (num < enough || *grid == std::pair(given.cols, given.rows)) return std::nullopt;
  Board meant = given;
  std::tie(meant.cols, meant.rows) = *grid;
  return WrongBoard{fmt::format("no photo shows the whole board of {}×{} corners, and all {} show {}×{}", given.cols,
                                given.rows, num, meant.cols, meant.rows),
                    "use " + changed_options(given, meant) + " if that is the whole board"};
}

}  // namespace alidade
