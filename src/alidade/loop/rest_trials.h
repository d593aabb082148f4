#pragma once

#include "alidade/loop/servo_scenario.h"

namespace alidade {

/// RMS about a target at rest once the lens has become as long as it will, unknown to the loop. [px]
[[nodiscard]] double zoomed_rest_px(const ServoScenario& scenario, ControllerKind kind);

/// A loop whose target has jumped by a quarter of the image and rests: how far from it a head is long after, as the
/// axes are and without their limits of rate and acceleration. Of the head that swings most.
struct Swing {
  double rms_px = 0.0, before_px = 0.0;  ///< In the last part of the time, and in the part before that.
  double free_px = 0.0;                  ///< Without limits.

  [[nodiscard]] double over_free() const;
  /// The limits keep it from rest: neither noise nor what decays.
  [[nodiscard]] bool is_for_good() const;
};
[[nodiscard]] bool has_limits(const ServoScene& scene);  ///< Of rate or acceleration.
[[nodiscard]] Swing swing_after_a_jump(const ServoScenario& scenario, ControllerKind kind);

}  // namespace alidade
