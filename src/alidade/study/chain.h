#pragma once

#include <cstdint>
#include <optional>

#include "alidade/pantilt/head.h"
#include "alidade/simulate/rig.h"
#include "alidade/simulate/track.h"

// The whole way of two heads, each step with what the one before found: photos of a board → lenses → views of boards →
// the rig → a target followed.

namespace alidade {

struct Chain {
  RigScene truth;
  Rig rig;  ///< As found, through the lenses as found.
};

/// Photos of a 9×6 board of each camera (640×480, corners 0.1 px), the last four where the first ones are least
/// informative; then five placements of the board seen by both heads (0.2 px, encoders 0.02°, their scales estimated).
/// None where a step has no answer.
[[nodiscard]] std::optional<Chain> draw_chain(std::uint64_t seed, int num_photos = 13);

/// A target about so far away for 3 s (0.3 px, 0.02°), as the true heads see it.
[[nodiscard]] TrackScene chain_track_scene(const Chain& chain, double range_m, std::uint64_t seed);

}  // namespace alidade
