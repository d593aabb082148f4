#pragma once

#include <string_view>

namespace alidade {

/// Cameras are dealt into so many parts by their names, and parts to workers.
inline constexpr int num_fleet_parts = 32;
/// The part of a camera, 0 … num_fleet_parts − 1: FNV-1a of its name, mixed so that the last characters reach all bits
/// (SplitMix64's finaliser: Steele, Lea & Flood, OOPSLA 2014).
[[nodiscard]] int fleet_part_of(std::string_view camera);

}  // namespace alidade
