#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "alidade/fleet/fleet_camera.h"
#include "alidade/fleet/row_order.h"
#include "alidade/simulate/fleet.h"

namespace alidade {

/// Parses a row that a camera publishes on cam.ID.obs: JSON, or CBOR, an object with n = 1, 2, 3 … and the columns of a
/// rotation log: t, pan and tilt (and roll; or pan_deg, tilt_deg), or qw qx qy qz, or omega_x omega_y (omega_z), and
/// p1x, p1y, p2x, …; null or absent: not seen; optionally temperature_c. None, with the fault, without n; a message
/// that has n but is otherwise invalid is a row without content.
[[nodiscard]] std::optional<FleetRow> parse_fleet_row(std::string_view payload, std::string& fault);
[[nodiscard]] std::string fleet_row_text(const FleetRow& row);
/// The n-th row of a simulated camera.
[[nodiscard]] FleetRow fleet_row_of(const FleetObservation& observation, std::int64_t n);

/// Text of cam.ID.state: depends only on the camera's messages 1 … n. Its sentence mentions rows that never arrived,
/// and `missing` and `restarts` are members of it, if there are any. n = 0: no row has been processed yet.
[[nodiscard]] std::string fleet_state_text(const std::string& id, const FleetCamera& camera,
                                           const FleetNumbers& numbers = {});
/// Text of cam.ID.alarm.
[[nodiscard]] std::string fleet_alarm_text(const std::string& id, const FleetAlarm& alarm);

/// Writes and reads the whole state of a camera as one line of text (base64); none if it is of another version.
[[nodiscard]] std::string checkpoint_text(const FleetCamera& camera);
[[nodiscard]] std::optional<FleetCamera> parse_checkpoint(std::string_view text);
/// The value of n in a state's text; 0: it has none.
[[nodiscard]] std::int64_t fleet_state_n(std::string_view text);

}  // namespace alidade
