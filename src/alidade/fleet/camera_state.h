#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <type_traits>

namespace alidade {

inline constexpr int max_fleet_points = 6;  ///< Of a row, the first ones; a camera's state has to stay small.
inline constexpr int fleet_learning_rows = 24;
/// fx, fy, cx, cy [px], zero of pan, zero of tilt [rad], relative change of fx and fy per °C.
inline constexpr int num_fleet_common = 7;
inline constexpr int num_fleet_channels = 3;  ///< Zero of pan, zero of tilt [rad], focal length (relative).

/// How the rotation of a row was measured.
enum class FleetSource : std::uint8_t { head, attitude, rate };

enum class FleetPhase : std::uint8_t {
  learning,  ///< Rows are kept until they determine the intrinsics and where the points are.
  tracking
};

enum class FleetAlarmKind : std::uint8_t { none, pan_zero, tilt_zero, focal_length, frozen, lost, focal_temperature };

/// Why nothing can be taken from a row, or (temperature, pixel) not all of it.
enum class FleetFault : std::uint8_t { none, time, rotation, another_rotation, too_large, temperature, pixel };

/// A row of a camera: what its rotation was, and where it saw static points. NaN: not seen.
struct FleetRow {
  std::int64_t n = 0;
  double t_s = 0.0;
  double temperature_c = std::numeric_limits<double>::quiet_NaN();  ///< Of the camera, where it is measured.
  FleetSource source = FleetSource::head;
  std::array<double, 4> rotation{};  ///< pan, tilt, roll [rad]; quaternion wxyz; rates x, y, z [rad/s].
  int num_points = 0;
  std::array<double, 2 * max_fleet_points> px{};
  FleetFault in_part = FleetFault::none;  ///< A temperature or a pixel that is there, but is no number.
};

/// A static point: a direction in the base, e + a e1 + b e2, and what is known of (a, b).
struct FleetPoint {
  std::array<double, 3> direction{};  ///< e, of length 1; e1 and e2 follow from it.
  std::array<double, 2> ab{};
  std::array<double, 2 * num_fleet_common> slope{};  ///< Of (a, b) over the shared parameters, row-major.
  std::array<double, 3> cov{};                       ///< Given those: aa, ab, bb.
};

/// A cumulative sum of one channel in one direction, and what the rows since it was zero say of the channel.
struct FleetSum {
  double sum = 0.0, score = 0.0, information = 0.0, since_s = 0.0;
};
using FleetSums = std::array<FleetSum, 2 * num_fleet_channels>;  ///< Up and down of each channel.

/// A detected change, estimated from some more rows before it is reported.
struct FleetChange {
  FleetAlarmKind kind = FleetAlarmKind::none;
  std::uint32_t rows_left = 0;
  double x_before = 0.0, variance_before = 0.0, since_s = 0.0;
};

struct FleetTracking {
  std::array<double, num_fleet_common> x{};
  std::array<double, num_fleet_common*(num_fleet_common + 1) / 2> P{};  ///< Upper triangle, row by row.
  std::array<FleetPoint, max_fleet_points> points{};
  FleetSums sums{};
  FleetChange change;
  float reference_c = std::numeric_limits<float>::quiet_NaN();  ///< Where fx and fy are what `x` says; NaN: none known.
  std::uint8_t has_said_drift = 0;
};

struct FleetLearning {
  /// Pan, tilt and roll of a head as they came, else the quaternion of the rotation; then pixels.
  std::array<std::array<float, 4 + 2 * max_fleet_points>, fleet_learning_rows> rows{};
};

/// All that is kept of a camera: a function of its messages 1 … n and of nothing else, which is what makes a worker
/// replaceable by any other. Plain bytes: a checkpoint is a copy of them. Below 2 kB.
struct FleetCamera {
  std::int64_t n = 0;
  double t_s = 0.0;
  double alarm_t_s = 0.0;  ///< Of the last alarm.
  double sum_nis = 0.0, sum_dof = 0.0;
  double sigma_px = 0.0;                               ///< Estimated from the initial rows.
  std::array<double, 4> attitude{1.0, 0.0, 0.0, 0.0};  ///< Of the last row, before the zeros; of rates their integral.
  std::array<double, 3> rate{};
  std::array<float, 2 * max_fleet_points> px{};  ///< Of the last row.
  FleetPhase phase = FleetPhase::learning;
  FleetSource source = FleetSource::head;
  FleetAlarmKind last_alarm = FleetAlarmKind::none;
  std::uint8_t num_points = 0, known_points = 0;  ///< known: bits of the points that are tracked.
  std::uint8_t has_row = 0;
  std::uint16_t num_buffered = 0, num_frozen = 0, num_gated = 0;
  std::uint32_t stride = 1, since_kept = 0;  ///< Every so many rows one is kept to learn from.
  double frozen_since_s = 0.0;
  float temperature_c = std::numeric_limits<float>::quiet_NaN();  ///< The last that was known.
  FleetFault last_fault = FleetFault::none;                       ///< Of the last row.
  std::uint8_t misread = 0;             ///< How its rotation seems to be misread; 0: it does not, or is not asked yet.
  std::uint8_t off_centre_percent = 0;  ///< Of the image's width or height (axis 1): the principal point; 0: near.
  std::uint8_t off_centre_axis = 0;
  union Body {
    FleetLearning learning;
    FleetTracking tracking;
    Body() : learning{} {}
  } body;
};
static_assert(std::is_trivially_copyable_v<FleetCamera> && sizeof(FleetCamera) <= 1920);

}  // namespace alidade
