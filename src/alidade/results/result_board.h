#pragma once

#include <nlohmann/json_fwd.hpp>

#include "alidade/board/board.h"

namespace alidade {

/// The board in the estimate of a result.json. Throws InputError where it is none.
[[nodiscard]] Board result_board(const nlohmann::json& json);

}  // namespace alidade
