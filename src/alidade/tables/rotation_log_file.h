#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/pantilt/rotation_log.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

struct RotationLogOptions {
  bool skip_bad = false;       ///< A wrong row is rejected and listed instead of thrown.
  bool needs_rotation = true;  ///< False: accept a log without rates, angles and attitude (`--rotation free`).
  bool needs_points = true;    ///< False: accept a log of the rotation alone (the points come from a video).
};

/// A log and its rejected rows: rows identical to the preceding one and, with `skip_bad`, wrong rows.
struct RotationLogFile {
  RotationLog log;
  std::vector<SkippedInput> skipped;
};

/// Reads a rotation log:
/// - `t` (or t_s) [s], never decreasing; a repeated time is kept unless everything else is identical too;
/// - one of omega_x, omega_y[, omega_z] (rad/s, camera frame) | pan, tilt[, roll] (rad; also pan_rad, pan_deg, …) |
///   qw, qx, qy, qz (base_from_cam, norm 1 ± 10⁻³); all empty: not measured in this row;
/// - p1x, p1y, p2x, p2y, … [px]; both empty: not seen;
/// - optionally vx, vy, vz (m/s, camera frame), range_m (to p1; empty: none), fx, fy, cx, cy (truth; also u0, v0), and
///   frame, which is ignored. No other column is accepted.
/// Throws InputError `log.csv:17: column 'p3x': …`; a log needs at least two rows and an observed point.
[[nodiscard]] RotationLogFile read_rotation_log(const std::filesystem::path& file,
                                                const RotationLogOptions& options = {});

/// Parses the text of such a file; `name` is used as the file name in messages.
[[nodiscard]] RotationLogFile parse_rotation_log(const std::string& text, const std::string& name,
                                                 const RotationLogOptions& options = {});

/// Text of a rotation log: time to 10⁻⁹ s, pixels to 10⁻⁶ px, angles and rates to 12 digits; empty if not measured.
[[nodiscard]] std::string rotation_log_csv(const RotationLog& log);

ALIDADE_PUBLIC_END
}  // namespace alidade
