#pragma once

#include <optional>

#include "alidade/fleet/fleet_camera.h"
#include "alidade/fleet/fleet_model.h"

namespace alidade {

/// Consecutive rows that do not fit, after which a camera is reinitialised.
inline constexpr int lost_rows = 60;

/// A row of a camera that is tracked: its innovations are summed for each kind of change, and taken in where they fit.
[[nodiscard]] std::optional<FleetAlarm> track_row(FleetCamera& camera, const FleetRow& row,
                                                  const FleetRotation& rotation, const FleetConfig& config);

/// What a row says of each channel: the score of a change, and its information; 0: nothing.
struct FleetScores {
  std::array<double, num_fleet_channels> score{}, information{};
};

/// One step of the sums with scores over their σ (standard normal while nothing changes): Page's sums up and down, with
/// an allowance of 1 σ, a single row counting 4 σ at most. The sum beyond the threshold that speaks most clearly; −1:
/// none.
[[nodiscard]] int add_scores(FleetSums& sums, const FleetScores& row, double noise_factor, double t_s,
                             double threshold);

}  // namespace alidade
