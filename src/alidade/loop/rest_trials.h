#pragma once

#include <string>

#include "alidade/loop/servo_scenario.h"

namespace alidade {

/// RMS for a target at rest once the lens has reached its longest focal length, unknown to the loop. [px]
[[nodiscard]] double zoomed_rest_px(const ServoScenario& scenario, ControllerKind kind);

/// A loop whose target has jumped by a quarter of the image and rests: oscillation of a head about its mean long after,
/// with the axes as they are and without limits, dead bands and backlash. For the head that oscillates most.
struct Swing {
  double rms_px = 0.0, before_px = 0.0;  ///< In the last part of the time, and in the part before it.
  double free_px = 0.0;                  ///< Without the nonlinearities.
  std::string cause = {};                ///< The one without which it settles, or all of them; empty: it settles.

  [[nodiscard]] double over_free() const;
  /// It does not settle: neither noise nor a decay.
  [[nodiscard]] bool is_for_good() const;
};
[[nodiscard]] bool is_linear(const ServoScene& scene);  ///< No limit of rate or acceleration, dead band or backlash.
[[nodiscard]] Swing swing_after_a_jump(const ServoScenario& scenario, ControllerKind kind);

}  // namespace alidade
