#pragma once

#include <numbers>

namespace alidade {

/// Radians of a degree: angles are radians everywhere but where people read or write them.
inline constexpr double degree = std::numbers::pi / 180.0;

}  // namespace alidade
