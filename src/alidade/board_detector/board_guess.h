#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "alidade/board/board.h"
#include "alidade/board_detector/find_boards.h"

namespace alidade {

/// The board that the photos show if they do not show the given one: squares counted instead of inner corners
/// or vice versa, columns and rows swapped or off by one, another dictionary of markers, a plain chessboard
/// instead of one with markers or vice versa. Tried on a few of the photos. `grids_seen`, if known: the sizes of
/// the chessboard grids in them; no other size is then tried for a plain chessboard. None if none of these boards is in
/// most of them. Propagates exceptions of `load_photo`.
[[nodiscard]] std::optional<Board> guess_board(std::size_t num_photos, const PhotoLoader& load_photo,
                                               const Board& given,
                                               const std::optional<std::vector<std::pair<int, int>>>& grids_seen = {},
                                               const Progress& progress = {});

/// If hardly any photo shows the given board: what is wrong, and what to do, "use --board 9x6: they show that
/// board".
struct WrongBoard {
  std::string reason, to_add;
};

/// The given board is not the one in the photos: another is in most of them, or many show a whole grid of another size,
/// so that the few in which the given one was found show parts of that grid. `reasons`: for each photo, why it shows no
/// board, empty if it does; `num_found`: in how many it was found; `in_vain`: which were searched without finding
/// it. None if the board is right, or nothing indicates another. Propagates exceptions of `load_photo`.
[[nodiscard]] std::optional<WrongBoard> wrong_board(std::span<const std::string> reasons, std::size_t num_found,
                                                    std::span<const std::size_t> in_vain, const PhotoLoader& load_photo,
                                                    const Board& given, const Progress& progress = {});

/// The same for photos with a grid that seems to be part of the given chessboard: five or more, all of them showing
/// exactly one smaller grid, which does not happen by chance.
[[nodiscard]] std::optional<WrongBoard> smaller_board(std::span<const BoardView> views, const Board& given);

/// The options that differ between two boards, as typed: "--board 7x10 --dictionary DICT_4X4_50".
[[nodiscard]] std::string changed_options(const Board& given, const Board& meant);

}  // namespace alidade
