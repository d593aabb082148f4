#pragma once

#include <cstddef>
#include <optional>
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

/// The options that differ between two boards, as they are typed: "--board 7x10 --dictionary DICT_4X4_50".
[[nodiscard]] std::string changed_options(const Board& given, const Board& meant);

}  // namespace alidade
