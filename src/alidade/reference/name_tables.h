#pragma once

#include <map>
#include <string>

namespace alidade {

/// By command: the names of its result, as parse_result_names() reads them.
using NameTables = std::map<std::string, std::string>;

[[nodiscard]] const NameTables& shared_names();    ///< By "@lens": names of many results, "@lens camera." in a table.
[[nodiscard]] const NameTables& camera_names();    ///< calibrate, corners, camera …, plan calibrate, simulate board
[[nodiscard]] const NameTables& observe_names();   ///< observe, plan observe, simulate rotation
[[nodiscard]] const NameTables& beam_names();      ///< rangefinder, plan rangefinder, project, simulate rangefinder
[[nodiscard]] const NameTables& motion_names();    ///< rig, track, localize, simulate …
[[nodiscard]] const NameTables& head_names();      ///< head
[[nodiscard]] const NameTables& study_names();     ///< identify, servo, reproduce …
[[nodiscard]] const NameTables& campaign_names();  ///< study …, batch

/// Tables of a tracked target, in the results of track and servo.
[[nodiscard]] const std::string& target_table_names();

}  // namespace alidade
