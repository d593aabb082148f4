#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/board/board_view.h"
#include "alidade/calibrate/calibrate.h"
#include "alidade/simulate/boards/board_photos.h"

namespace alidade::bench {

/// A board and a number of photos of it, written 9x6x20.
struct SolveCase {
  int cols = 9, rows = 6, num_photos = 20;
};
[[nodiscard]] std::string name_of(const SolveCase& solve_case);
[[nodiscard]] std::optional<SolveCase> parse_case(std::string_view text);

/// The rows of docs/performance.md.
[[nodiscard]] std::vector<SolveCase> all_cases();

/// Simulated corners of a case: Brown lens, 1280 × 960, 0.1 px of noise, always the same.
struct Corners {
  Board board;
  ImageSize size;
  std::vector<BoardView> views;
};
[[nodiscard]] Corners draw_corners(const SolveCase& solve_case);

/// A VGA photo with a 9×6 board in it; `seed` draws the pose and the noise.
[[nodiscard]] cv::Mat vga_photo_with_board(std::uint64_t seed);

/// 1280 × 800 of texture of all sizes (blots from 1 to 64 px with hard edges among them) and noise; no board.
[[nodiscard]] cv::Mat megapixel_photo_without_board();

}  // namespace alidade::bench
