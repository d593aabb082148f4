#pragma once

#include <string>

#include "alidade/board/board.h"

namespace alidade {

/// The board in the estimate of a result.json, from its JSON text. Throws InputError if there is none.
[[nodiscard]] Board result_board(const std::string& json);

}  // namespace alidade
