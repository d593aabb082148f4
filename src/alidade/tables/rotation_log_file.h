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
  bool skip_bad = false;       ///< A wrong row is rejected and listed, not thrown.
  bool needs_rotation = true;  ///< False: a log without rates, angles and attitude will do (`--rotation free`).
  bool needs_points = true;    ///< False: a log of the rotation alone will do (a video has the points).
};

/// A log and what was rejected of it: rows that say the same as the one before, and wrong ones with `skip_bad`.
struct RotationLogFile {
  RotationLog log;
  std::vector<SkippedInput> skipped;
};

/// Reads a rotation log:
/// - `t` (or t_s), s, never going back; the same time twice is kept unless all else is the same too;
/// - one of omega_x, omega_y[, omega_z] (rad/s, camera frame) | pan, tilt[, roll] (rad; also pan_rad, pan_deg, …) |
///   qw, qx, qy, qz (base_from_cam, norm 1 ± 10⁻³); all empty: not measured in this row;
/// - p1x, p1y, p2x, p2y, …, px; both empty: not seen;
/// - perhaps vx, vy, vz (m/s, camera frame), range_m (to p1; empty: none), fx, fy, cx, cy (truth; u0, v0 too), and
///   frame, which is not read. Nothing else.
/// Throws InputError `log.csv:17: column 'p3x': …`; a log has two rows or more and a point that is seen.
[[nodiscard]] RotationLogFile read_rotation_log(const std::filesystem::path& file,
                                                const RotationLogOptions& options = {});

/// The same of text that is at hand; `name` stands for the file in messages.
[[nodiscard]] RotationLogFile parse_rotation_log(const std::string& text, const std::string& name,
                                                 const RotationLogOptions& options = {});

/// Text of a rotation log: time to 10⁻⁹ s, pixels to 10⁻⁶ px, angles and rates to 12 digits; empty where not measured.
[[nodiscard]] std::string rotation_log_csv(const RotationLog& log);

ALIDADE_PUBLIC_END
}  // namespace alidade
