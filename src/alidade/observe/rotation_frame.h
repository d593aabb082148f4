#pragma once

#include <optional>
#include <span>

#include "alidade/pantilt/rotation_log.h"

namespace alidade {

/// For a head: scale, backlash, zero and curve of both axes, the angle between them, clock.
inline constexpr int max_rotation_errors = 16;
using TurnByErrors = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, max_rotation_errors>;

/// One instant as the estimators of a rotating camera use it: the rotation of the camera since the start, and what it
/// observed. A static point m has m(t) = R m(0) + shift in the camera frame, Ṙ = −[ω]× R.
/// Fang, Liu, Li & Zhang, "A global exponential observer for camera calibration", 2011, eq. (3).
struct RotationFrame {
  double t_s = 0.0;
  double dt_s = 0.0;                                                   ///< Since the frame before; 0 for the first.
  Eigen::Quaterniond cam_from_start = Eigen::Quaterniond::Identity();  ///< R.
  Eigen::Vector3d rate_rad_per_s =
      Eigen::Vector3d::Zero();  ///< ω at this instant, camera frame (or the mean, if not measured).
  Eigen::Vector3d mean_rate_rad_per_s = Eigen::Vector3d::Zero();      ///< Mean ω since the frame before.
  Eigen::Vector3d acceleration_rad_per_s2 = Eigen::Vector3d::Zero();  ///< ω̇, from the last two samples.
  Eigen::Vector3d shift_m = Eigen::Vector3d::Zero();                  ///< From the measured velocity; zero without one.
  double range_m = not_seen;                                          ///< Range of the log's range point.
  /// Effect of errors of the measured rotation: true = Exp(turn_by · errors) · cam_from_start [rad].
  TurnByErrors turn_by = TurnByErrors(3, 0);
  /// The rotation since the frame before is unknown (a gap in a rate log): earlier observations are
  /// related to later ones only through the intrinsics. cam_from_start restarts at the identity.
  bool starts_segment = false;
  std::span<const Eigen::Vector2d> px;  ///< One per point; NaN: not seen.
};

/// Converts rows to frames one by one. Rates are integrated by the third-order Adams–Moulton rule for
/// uneven steps with the commutator term, so that sampling a smooth motion causes errors of 10⁻⁷ rad, not
/// 10⁻⁵; heads and attitudes are used as they are. A row whose rotation was not measured gives a frame
/// without pixels; a gap longer than `max_gap_s` in a rate log starts a segment. Allocates nothing.
class MotionReader {
 public:
  MotionReader(RotationSource source, double max_gap_s) : source_(source), max_gap_s_(max_gap_s) {}

  /// Frame of the next row; its px refer to the row. Times must not decrease.
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

/// Rates and accelerations from the rotations two frames before and after. A difference that uses the frame's own
/// rotation contains its noise, which a delay would seem to explain. None if those frames are over 2 `max_gap_s` apart.
void take_central_rates(double max_gap_s, std::span<RotationFrame> frames);

}  // namespace alidade
