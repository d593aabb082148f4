#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "alidade/estimation/verdict.h"
#include "alidade/fleet/camera_state.h"

namespace alidade {

struct FleetConfig {
  int width_px = 0, height_px = 0;
  /// Of the cumulative sums, in σ. 9.5: below one false alarm a camera and year at a row a second;
  /// docs/scale.md says how that was found.
  double threshold = 9.5;
};

/// What changed: the zero of pan or tilt [rad], the focal length (relative; with the temperature: per °C), or for how
/// long the image has been the same or fits nothing [s].
struct FleetAlarm {
  FleetAlarmKind kind = FleetAlarmKind::none;
  std::int64_t n = 0;
  double t_s = 0.0, value = 0.0, sigma = 0.0;
  double since_s = 0.0;  ///< When it began, by the rows.
};

/// Takes the next row in: n = camera.n + 1. What it says at once, if anything. The state afterwards depends on the rows
/// 1 … n alone. An extended Kalman filter on intrinsics, zeros and points with an arrowhead covariance (as observe has
/// it), whose whitened scores of each kind of change are summed: E. S. Page, "Continuous inspection schemes",
/// Biometrika 41, 1954.
[[nodiscard]] std::optional<FleetAlarm> advance(FleetCamera& camera, const FleetRow& row, const FleetConfig& config);

/// Why advance() takes nothing from a row but its number; what of a row in part is in the row.
[[nodiscard]] FleetFault fault_of(const FleetCamera& camera, const FleetRow& row);
/// Not of what is a fault of a row in part.
[[nodiscard]] bool says_nothing(FleetFault fault);
/// "t is not a number of seconds".
[[nodiscard]] const char* sentence_of(FleetFault fault);

/// What is known of a camera after its last row.
struct FleetEstimate {
  bool has_value = false;
  bool has_temperature = false;  ///< fx and fy are those at the temperature of the first rows that had one.
  Eigen::Matrix<double, num_fleet_common, 1> value,
      sigma;  ///< fx, fy, cx, cy [px], zeros of pan and tilt [rad], f per °C.
};
[[nodiscard]] FleetEstimate estimate_of(const FleetCamera& camera);
[[nodiscard]] Verdict verdict_of(const FleetCamera& camera);

/// "pan_zero", "tilt_zero", "focal_length", "frozen", "lost", "focal_temperature".
[[nodiscard]] std::string kind_name(FleetAlarmKind kind);
/// "the zero of pan moved by 0.31° ± 0.04°".
[[nodiscard]] std::string sentence_of(const FleetAlarm& alarm);

}  // namespace alidade
