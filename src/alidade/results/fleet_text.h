#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "alidade/fleet/fleet_camera.h"
#include "alidade/fleet/row_order.h"
#include "alidade/simulate/fleet.h"

namespace alidade {

/// A row as a camera says it on cam.ID.obs: JSON, or CBOR, an object with n = 1, 2, 3 … and the columns of a rotation
/// log: t, pan and tilt (and roll; or pan_deg, tilt_deg), or qw qx qy qz, or omega_x omega_y (omega_z), and p1x, p1y,
/// p2x, …; null or no member: not seen; temperature_c, where it is measured. None, and why, for what has no n; what has
/// a number but is otherwise none of these is a row that says nothing.
[[nodiscard]] std::optional<FleetRow> parse_fleet_row(std::string_view payload, std::string& fault);
[[nodiscard]] std::string fleet_row_text(const FleetRow& row);
/// The n-th row of a simulated camera.
[[nodiscard]] FleetRow fleet_row_of(const FleetObservation& observation, std::int64_t n);

/// Of cam.ID.state: a function of the camera's messages 1 … n alone. Rows that never came are in its sentence, and
/// `missing` and `restarts` are members of it, where there are any. n = 0: no row has been taken in yet.
[[nodiscard]] std::string fleet_state_text(const std::string& id, const FleetCamera& camera,
                                           const FleetNumbers& numbers = {});
/// Of cam.ID.alarm.
[[nodiscard]] std::string fleet_alarm_text(const std::string& id, const FleetAlarm& alarm);

/// All of a camera's state as text of one line (base64), and back; none where it is of another version.
[[nodiscard]] std::string checkpoint_text(const FleetCamera& camera);
[[nodiscard]] std::optional<FleetCamera> parse_checkpoint(std::string_view text);
/// n of a state's text; 0: it has none.
[[nodiscard]] std::int64_t fleet_state_n(std::string_view text);

}  // namespace alidade
