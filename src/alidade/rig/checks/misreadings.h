#pragma once

#include <optional>
#include <string>
#include <vector>

#include "alidade/rig/rig_work.h"

namespace alidade {

/// Another reading of the same table, by which its views may agree.
struct Misreading {
  std::string words;
  std::vector<HeadView> views;
  bool is_common = false;  ///< Tried where only a few views are rejected, too.
  std::string remedy = "give each view what its own pan and tilt encoders read";
  /// Of the angle by which the boards' rotations contradict each other as read, what is left; none: it does not change
  /// these, or no view determines any.
  std::optional<double> misfit_left = {};
};

/// How far the rotations of the heads' boards contradict each other with the heads and readings of these views, those
/// of the table, whatever the rest of the rig is: mean angle of all that can be compared. 0: nothing can. `work`: with
/// its views' poses.
[[nodiscard]] double rotation_misfit_rad(const Work& work, std::span<const HeadView> views);

/// Exchanged, shifted, half and double angles, corners numbered from the other end, of all heads, then of each; angles
/// shifted or heads exchanged in a part of the table. Those by which the boards' rotations agree no better are left
/// out.
[[nodiscard]] std::vector<Misreading> misreadings(const Work& work);

}  // namespace alidade
