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

/// State of a controller at one step.
enum class ServoEvent { none, waiting, started, gated, jumped, lost, searching, found };
[[nodiscard]] std::string_view servo_event_name(ServoEvent event);

/// What to do while the target is not visible: first coast along its predicted path, then search in a spiral around it.
struct SearchConfig {
  bool enabled = true;
  double coast_s = 0.3;         ///< After this time without an observation the target counts as lost.
  double carry_s = 0.2;         ///< Time in which the lost target's rate is assumed to decay.
  double speed_rad_s = 1.0;     ///< Speed of the optical axis along the spiral.
  double turn_of_view = 0.7;    ///< Distance between turns of the spiral, in image heights.
  double max_radius_rad = 0.8;  ///< The search then restarts from the centre.
};

/// Controller of one head, the same for both axes.
struct ServoConfig {
  ControllerKind controller = ControllerKind::feedforward;
  double period_s = 0.05;
  std::array<ServoAxis, 2> axes{};  ///< (pan, tilt) as known to the controller.
  PiGains pi;                       ///< For `pi`, and for the feedback part of `feedforward` on an angle plant.
  double rate_gain_per_s = 8.0;     ///< For `feedforward` on a rate plant: rate per angle of error.
  double command_weight = 2.0;      ///< For `lqr` and `mpc`: cost of effort relative to error.
  double sigma_px = 0.5;            ///< σ of one pixel coordinate of the target.
  double sigma_encoder_rad = 0.0008726646259971648;
  double range_m = 1.0;  ///< Rough range of the target: only matters if the axes of a head do not intersect.
  BearingFilterConfig filter;
  SearchConfig search;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
