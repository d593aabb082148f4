#pragma once

#include <istream>
#include <optional>
#include <string>
#include <vector>

#include "alidade/tables/logs/rotation_log_columns.h"
#include "alidade/tables/rotation_log_file.h"

namespace alidade {

struct RotationLogEntry {
  RotationRow row;
  std::optional<TrueIntrinsics> truth;
  std::size_t line = 0;
};

/// A rotation log row by row as it arrives, with the checks of read_rotation_log().
class RotationLogStream {
 public:
  /// Reads the header.
  RotationLogStream(std::istream& in, const std::string& name, const RotationLogOptions& options = {});

  /// A log without rows, which defines what every row has.
  [[nodiscard]] const RotationLog& layout() const { return layout_; }
  /// The next row that is not rejected; none at the end. Throws InputError; the next call continues after the
  /// fault.
  [[nodiscard]] std::optional<RotationLogEntry> next();
  [[nodiscard]] const std::vector<SkippedInput>& skipped() const { return skipped_; }

 private:
  [[nodiscard]] std::optional<RotationLogEntry> next_checked();
  void unwrap(Eigen::Vector3d& angles_rad);

  CsvStream table_;
  RotationLogOptions options_;
  RotationLogColumns columns_;
  RotationLog layout_;
  std::optional<RotationLogEntry> last_;
  Eigen::Vector3d last_angles_ = Eigen::Vector3d::Zero();  ///< Angles of the newest row with angles.
  std::vector<SkippedInput> skipped_;
};

}  // namespace alidade
