#pragma once

#include <string>

#include "alidade/loop/servo_scenario.h"

namespace alidade {

/// RMS about a target at rest once the lens has become as long as it will, unknown to the loop. [px]
[[nodiscard]] double zoomed_rest_px(const ServoScenario& scenario, ControllerKind kind);

/// A loop whose target has jumped by a quarter of the image and rests: how far a head swings about its mean long after,
/// as the axes are and without their limits, dead bands and backlash. Of the head that swings most.
struct Swing {
  double rms_px = 0.0, before_px = 0.0;  ///< In the last part of the time, and in the part before that.
  double free_px = 0.0;                  ///< Without what is not linear.
  std::string cause = {};                ///< Without which alone it rests, or all of it; empty: it rests.

  [[nodiscard]] double over_free() const;
  /// It is kept from rest: neither noise nor what decays.
  [[nodiscard]] bool is_for_good() const;
};
[[nodiscard]] bool is_linear(const ServoScene& scene);  ///< No limit of rate or acceleration, dead band or backlash.
[[nodiscard]] Swing swing_after_a_jump(const ServoScenario& scenario, ControllerKind kind);

}  // namespace alidade
