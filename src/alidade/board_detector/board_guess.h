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

/// The board that photos show where they do not show the one that was given: squares counted instead of inner corners
/// or the other way round, columns and rows swapped or off by one, another dictionary of markers, a plain chessboard
/// for one with markers or the other way round. Tried on a few of the photos. `grids_seen`, where known: the sizes of
/// the chessboard grids in them; no other is then tried for a plain chessboard. None where none of these boards is in
/// most of them. Throws what `load_photo` throws.
[[nodiscard]] std::optional<Board> guess_board(std::size_t num_photos, const PhotoLoader& load_photo,
                                               const Board& given,
                                               const std::optional<std::vector<std::pair<int, int>>>& grids_seen = {},
                                               const Progress& progress = {});

/// Where next to no photo shows the board as given: what is wrong, and what to do, "use --board 9x6: they show that
/// board".
struct WrongBoard {
  std::string reason, to_add;
};

/// The board given is not the one in the photos: another is in most of them, or many show a whole grid of another size,
/// so that the few in which the given one was found show parts of that grid. `reasons`: of each photo, why it shows no
/// board, empty where it does; `num_found`: in how many it was found; `in_vain`: which were searched without finding
/// it. None where the board is right, or nothing says which it is. Throws what `load_photo` throws.
[[nodiscard]] std::optional<WrongBoard> wrong_board(std::span<const std::string> reasons, std::size_t num_found,
                                                    std::span<const std::size_t> in_vain, const PhotoLoader& load_photo,
                                                    const Board& given, const Progress& progress = {});

/// The same of photos that show a grid that seems to be part of the chessboard given: five or more, all of them the
/// whole of one smaller grid, which no camera sees by chance.
[[nodiscard]] std::optional<WrongBoard> smaller_board(std::span<const BoardView> views, const Board& given);

/// The options that differ between two boards, as they are typed: "--board 7x10 --dictionary DICT_4X4_50".
[[nodiscard]] std::string changed_options(const Board& given, const Board& meant);

}  // namespace alidade
