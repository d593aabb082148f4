#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "alidade/board/board.h"

namespace alidade {

/// A predefined family of square markers: its number in OpenCV's list and its number of markers.
struct MarkerDictionary {
  int opencv_id = 0;
  int num_markers = 0;
};

/// The dictionary with a name such as DICT_5X5_100. None for an unknown name.
[[nodiscard]] std::optional<MarkerDictionary> marker_dictionary(std::string_view name);

/// All names, comma-separated, for messages.
[[nodiscard]] std::string marker_dictionary_names();

/// Why such a board is impossible, in one sentence without a full stop; empty if it is possible.
[[nodiscard]] std::string fault(const Board& board);

}  // namespace alidade
