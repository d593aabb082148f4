#pragma once

#include <optional>
#include <string>
#include <vector>

#include "alidade/rig/rig_work.h"

namespace alidade {

/// Another interpretation of the same table that may make its views agree.
struct Misreading {
  std::string words;
  std::vector<HeadView> views;
  bool is_common = false;  ///< Also tried if only a few views are rejected.
  std::string remedy = "give each view what its own pan and tilt encoders read";
  /// Of the angle by which the boards' rotations contradict each other, the fraction that remains; none: it does not
  /// change these, or no view determines any.
  std::optional<double> misfit_left = {};
};

/// How much the rotations of the heads' boards contradict each other with the heads and readings of these views, which
/// are those of the table, whatever the rest of the rig is: mean angle over all comparable pairs. 0: none. `work`: with
/// the poses of its views.
[[nodiscard]] double rotation_misfit_rad(const Work& work, std::span<const HeadView> views);

/// Exchanged, shifted, half and double angles, corners numbered from the other end, for all heads, then for each;
/// angles shifted or heads exchanged in part of the table. Those that do not improve the agreement of the boards'
/// rotations are omitted.
[[nodiscard]] std::vector<Misreading> misreadings(const Work& work);

}  // namespace alidade
