#pragma once

#include <array>
#include <optional>
#include <string_view>

#include "alidade/pantilt/servo_plant.h"
#include "alidade/public.h"
#include "alidade/servo/bearing_filter.h"
#include "alidade/servo/loop_analysis.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

enum class ControllerKind { pi, feedforward, lqr, mpc };
inline constexpr std::array controller_kinds{ControllerKind::pi, ControllerKind::feedforward, ControllerKind::lqr,
                                             ControllerKind::mpc};
[[nodiscard]] std::string_view controller_name(ControllerKind kind);  ///< pi, feedforward, lqr, mpc
[[nodiscard]] std::optional<ControllerKind> controller_named(std::string_view name);

/// Mode of a controller at one step.
enum class ServoEvent { none, waiting, started, gated, jumped, lost, searching, found };
[[nodiscard]] std::string_view servo_event_name(ServoEvent event);

/// When the target is not seen: first coast along its predicted path, then search around the prediction in a spiral.
struct SearchConfig {
  bool enabled = true;
  double coast_s = 0.3;         ///< Without an observation for so long the target counts as lost.
  double carry_s = 0.2;         ///< The lost target's rate is assumed to decay in this time.
  double speed_rad_s = 1.0;     ///< Of the view along the spiral.
  double turn_of_view = 0.7;    ///< From one turn of the spiral to the next, in heights of the image.
  double max_radius_rad = 0.8;  ///< Then from the centre again.
};

/// A controller of one head, both axes alike.
struct ServoConfig {
  ControllerKind controller = ControllerKind::feedforward;
  double period_s = 0.05;
  std::array<ServoAxis, 2> axes{};  ///< (pan, tilt) as they are known.
  PiGains pi;                       ///< `pi`, and what corrects `feedforward` on an angle plant.
  double rate_gain_per_s = 8.0;     ///< `feedforward` on a rate plant: rate per angle of error.
  double command_weight = 2.0;      ///< `lqr` and `mpc`: what effort costs beside error.
  double sigma_px = 0.5;            ///< Of the target's pixel coordinate.
  double sigma_encoder_rad = 0.0008726646259971648;
  double range_m = 1.0;  ///< Of the target, about: matters only where a head's axes do not meet.
  BearingFilterConfig filter;
  SearchConfig search;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
