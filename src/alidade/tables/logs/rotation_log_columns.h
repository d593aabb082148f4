#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "alidade/files/csv.h"
#include "alidade/pantilt/rotation_log.h"

namespace alidade {

/// Which column of a rotation log contains what: indices in the header.
struct RotationLogColumns {
  /// An angle's column and what its unit is in radians.
  struct Angle {
    std::size_t column = 0;
    double unit_rad = 1.0;
  };

  std::vector<std::string> names;  ///< The header.
  RotationSource source = RotationSource::none;
  std::size_t t = 0;
  double t_unit_s = 0.0;          ///< 0: by how large the time is: s, or the ms, µs, ns since 1970.
  std::vector<std::size_t> rate;  ///< ω_x, ω_y, perhaps ω_z.
  std::vector<Angle> head;        ///< Pan, tilt, perhaps roll.
  std::vector<std::size_t> quaternion, velocity, truth;
  std::vector<std::array<std::size_t, 2>> points;
  std::optional<std::size_t> range, sigma_scale, sigma_parallax;
};

/// Finds them in the header. Throws InputError naming the column: an unknown one (with what was probably meant), one
/// without its partner, points that are not numbered 1, 2, …, two kinds of rotation, none where it is needed.
[[nodiscard]] RotationLogColumns rotation_log_columns(const CsvStream& table, bool needs_rotation,
                                                      bool needs_points = true);

/// What a row holds by these columns. Throws InputError.
[[nodiscard]] RotationRow rotation_row(const CsvRow& row, const RotationLogColumns& columns, const std::string& file);
/// A column that is the same in every row, as σ of the angles' scale. Throws InputError.
[[nodiscard]] std::optional<double> given_share(const CsvRow& row, const std::optional<std::size_t>& column,
                                                const RotationLogColumns& columns, const std::string& file);
[[nodiscard]] std::optional<TrueIntrinsics> true_intrinsics(const CsvRow& row, const RotationLogColumns& columns,
                                                            const std::string& file);

/// A pixel coordinate, |x| ≤ 10⁶. Throws InputError.
[[nodiscard]] double csv_pixel(const std::string& cell, const CsvPlace& place);

}  // namespace alidade
