#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "alidade/files/csv.h"
#include "alidade/pantilt/rotation_log.h"

namespace alidade {

/// The columns of a rotation log: indices in the header.
struct RotationLogColumns {
  /// An angle's column, and its unit in radians.
  struct Angle {
    std::size_t column = 0;
    double unit_rad = 1.0;
  };

  std::vector<std::string> names;  ///< The header.
  RotationSource source = RotationSource::none;
  std::size_t t = 0;
  double t_unit_s = 0.0;          ///< 0: judged by the size of the time: s, or ms, µs, ns since 1970.
  std::vector<std::size_t> rate;  ///< ω_x, ω_y, optionally ω_z.
  std::vector<Angle> head;        ///< Pan, tilt, optionally roll.
  std::vector<std::size_t> quaternion, velocity, truth;
  std::vector<std::array<std::size_t, 2>> points;
  std::optional<std::size_t> range, sigma_scale, sigma_parallax;
};

/// Finds the columns in the header. Throws InputError that names the column: unknown (with what was probably meant),
/// without its partner, points not numbered 1, 2, …, two kinds of rotation, or none although it is needed.
[[nodiscard]] RotationLogColumns rotation_log_columns(const CsvStream& table, bool needs_rotation,
                                                      bool needs_points = true);

/// The content of a row by these columns. Throws InputError.
[[nodiscard]] RotationRow rotation_row(const CsvRow& row, const RotationLogColumns& columns, const std::string& file);
/// A column that is the same in every row, such as σ of the angles' scale. Throws InputError.
[[nodiscard]] std::optional<double> given_share(const CsvRow& row, const std::optional<std::size_t>& column,
                                                const RotationLogColumns& columns, const std::string& file);
[[nodiscard]] std::optional<TrueIntrinsics> true_intrinsics(const CsvRow& row, const RotationLogColumns& columns,
                                                            const std::string& file);

/// A pixel coordinate, |x| ≤ 10⁶. Throws InputError.
[[nodiscard]] double csv_pixel(const std::string& cell, const CsvPlace& place);

}  // namespace alidade
