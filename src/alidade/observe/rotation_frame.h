#pragma once

#include <optional>
#include <span>

#include "alidade/pantilt/rotation_log.h"

namespace alidade {

/// Of a head: scale, backlash, zero and curve of both axes, the angle between these, clock.
inline constexpr int max_rotation_errors = 16;
using TurnByErrors = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, max_rotation_errors>;

/// One instant as the estimators of a rotating camera take it: how the camera has rotated since the start, and what it
/// saw. A static point m has m(t) = R m(0) + shift in the camera frame, Ṙ = −[ω]× R.
/// Fang, Liu, Li & Zhang, "A global exponential observer for camera calibration", 2011, eq. (3).
struct RotationFrame {
  double t_s = 0.0;
  double dt_s = 0.0;                                                   ///< Since the frame before; 0 at the first.
  Eigen::Quaterniond cam_from_start = Eigen::Quaterniond::Identity();  ///< R.
  Eigen::Vector3d rate_rad_per_s =
      Eigen::Vector3d::Zero();  ///< ω at this instant, camera frame (or the mean, if not measured).
  Eigen::Vector3d mean_rate_rad_per_s = Eigen::Vector3d::Zero();      ///< Mean ω since the frame before.
  Eigen::Vector3d acceleration_rad_per_s2 = Eigen::Vector3d::Zero();  ///< ω̇, from the last two samples.
  Eigen::Vector3d shift_m = Eigen::Vector3d::Zero();                  ///< From measured velocity; zero without.
  double range_m = not_seen;                                          ///< To the log's range point.
  /// How errors of the measured rotation rotate it: true = Exp(turn_by · errors) · cam_from_start. [rad]
  TurnByErrors turn_by = TurnByErrors(3, 0);
  /// The rotation since the frame before is not known (a gap in a rate log): what was seen before does not bind what
  /// is seen now but through the intrinsics. cam_from_start starts again at the identity.
  bool starts_segment = false;
  std::span<const Eigen::Vector2d> px;  ///< One per point; NaN: not seen.
};

/// Converts rows to frames one by one. Rates are integrated by the third-order Adams–Moulton rule for uneven steps
/// with the commutator term, so that the sampling of a smooth motion costs 10⁻⁷ rad, not 10⁻⁵; heads and attitudes are
/// taken as they are. A row whose rotation was not measured gives a frame without pixels; a gap of a rate log that is
/// longer than `max_gap_s` starts a segment. Allocates nothing.
class MotionReader {
 public:
  MotionReader(RotationSource source, double max_gap_s) : source_(source), max_gap_s_(max_gap_s) {}

  /// Frame of the next row; its px point into the row. Times must not decrease.
  [[nodiscard]] RotationFrame next(const RotationRow& row);

 private:
  [[nodiscard]] std::optional<Eigen::Quaterniond> attitude_of(const RotationRow& row) const;
  void advance_by_rate(const Eigen::Vector3d& rate_rad_per_s, RotationFrame& frame);
  void advance_by_attitude(const Eigen::Quaterniond& base_from_cam, RotationFrame& frame);
  void advance_shift(const Eigen::Vector3d& velocity_m_per_s, const RotationFrame& frame);

  RotationSource source_;
  double max_gap_s_;
  bool has_last_ = false, has_before_ = false;
  double last_t_s_ = 0.0, last_dt_s_ = 0.0;
  Eigen::Vector3d last_rate_ = Eigen::Vector3d::Zero(), before_rate_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d last_mean_rate_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d last_velocity_ = Eigen::Vector3d::Zero(), shift_m_ = Eigen::Vector3d::Zero();
  Eigen::Quaterniond last_base_from_cam_ = Eigen::Quaterniond::Identity();
  Eigen::Quaterniond cam_from_start_ = Eigen::Quaterniond::Identity();
};

/// Rates and accelerations from the rotations two frames before and after. A difference to the frame's own rotation has
/// its noise: what is late would seem to explain it. None where such frames are more than twice `max_gap_s` apart.
void take_central_rates(double max_gap_s, std::span<RotationFrame> frames);

}  // namespace alidade
