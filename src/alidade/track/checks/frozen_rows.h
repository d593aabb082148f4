#pragma once

#include <optional>
#include <span>
#include <string>

#include "alidade/pantilt/rig.h"
#include "alidade/pantilt/target_observation.h"

namespace alidade {

/// Rows of a head that repeat the one before them exactly.
struct FrozenRows {
  std::size_t head = 0;
  bool is_of_pixels = false;  ///< Else of the readings.
  std::size_t num = 0;        ///< Of rows that repeat.
  double from_s = 0.0, until_s = 0.0;
};

/// The longest such run of all heads that chance does not explain: pixels, where those of the head otherwise hardly
/// ever repeat, and are no multiples of a coarse step (a target at rest); readings, where besides the first one after
/// it is further away than the head goes in that time elsewhere (a head at rest starts slowly). Observations are in
/// order of capture.
[[nodiscard]] std::optional<FrozenRows> frozen_rows(std::span<const TargetObservation> observations,
                                                    std::size_t num_heads);

/// "the pixels of head 2 are exactly the same in 20 rows from 7.3 to 8.3 s: …".
[[nodiscard]] std::string frozen_text(const FrozenRows& frozen, std::span<const RigHead> heads);

/// "leave out the rows of head 2 from 7.3 to 8.3 s".
[[nodiscard]] std::string frozen_remedy(const FrozenRows& frozen, std::span<const RigHead> heads);

}  // namespace alidade
