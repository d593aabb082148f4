#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "alidade/files/csv.h"
#include "alidade/pantilt/head.h"

namespace alidade {

/// Index in the rig's list of the head whose id is in column `head`. Throws InputError if there is no such head.
[[nodiscard]] std::size_t head_in_row(const Csv& csv, std::size_t row, std::span<const RigHead> heads);

/// An angle [rad] in a row. Throws InputError if it is not a number, or too large for an angle.
[[nodiscard]] double angle_in_row(const Csv& csv, std::size_t row, const std::string& column);

}  // namespace alidade
