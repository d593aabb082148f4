#pragma once

#include <filesystem>
#include <istream>
#include <optional>
#include <string>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/pantilt/rotation_log.h"
#include "alidade/tables/rotation_log_columns.h"

namespace alidade {

struct RotationLogOptions {
  bool skip_bad = false;       ///< A wrong row is left out and listed, not thrown.
  bool needs_rotation = true;  ///< False: a log without rates, angles and attitude will do (`--rotation free`).
  bool needs_points = true;    ///< False: a log of the rotation alone will do (a video has the points).
};

/// A log and what was left out of it: rows that say the same as the one before, and wrong ones with `skip_bad`.
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

struct RotationLogEntry {
  RotationRow row;
  std::optional<TrueIntrinsics> truth;
  std::size_t line = 0;
};

/// The same row by row as it arrives, with the same checks.
class RotationLogStream {
 public:
  /// Reads the header.
  RotationLogStream(std::istream& in, const std::string& name, const RotationLogOptions& options = {});

  /// A log without rows: what every row will have.
  [[nodiscard]] const RotationLog& layout() const { return layout_; }
  /// The next row that is not left out; none at the end. Throws InputError; the call after that goes on behind the
  /// fault.
  [[nodiscard]] std::optional<RotationLogEntry> next();
  [[nodiscard]] const std::vector<SkippedInput>& skipped() const { return skipped_; }

 private:
  [[nodiscard]] std::optional<RotationLogEntry> next_checked();

  CsvStream table_;
  RotationLogOptions options_;
  RotationLogColumns columns_;
  RotationLog layout_;
  std::optional<RotationLogEntry> last_;
  std::vector<SkippedInput> skipped_;
};

/// Text of a rotation log: time to 10⁻⁹ s, pixels to 10⁻⁶ px, angles and rates to 12 digits; empty where not measured.
[[nodiscard]] std::string rotation_log_csv(const RotationLog& log);

}  // namespace alidade
