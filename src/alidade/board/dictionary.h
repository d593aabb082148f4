#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "alidade/board/board.h"

namespace alidade {

/// A predefined family of square markers: its number in OpenCV's list and how many markers it has.
struct MarkerDictionary {
  int opencv_id = 0;
  int num_markers = 0;
};

/// The dictionary of a name such as DICT_5X5_100. None for an unknown name.
[[nodiscard]] std::optional<MarkerDictionary> marker_dictionary(std::string_view name);

/// All names, comma-separated, for messages.
[[nodiscard]] std::string marker_dictionary_names();

/// Why there is no such board, in one sentence without a full stop; empty where there is one.
[[nodiscard]] std::string fault(const Board& board);

}  // namespace alidade
