#pragma once

#include <Eigen/Geometry>
#include <optional>

#include "alidade/observe/rotation_frame.h"

namespace alidade {

/// What is estimated beside fx, fy, cx, cy.
struct ObserveNuisances {
  bool k1 = false;  ///< Radial distortion: x (1 + k1 r² + k2 r⁴ + k3 r⁶) on coordinates over the focal length.
  bool k2 = false;
  bool k3 = false;
  bool tangential = false;  ///< p1, p2, as Brown has them.
  bool mount = false;       ///< Rotation from the frame whose rotation is measured to the camera's, 3 angles.
  bool delay = false;       ///< Pixels are of t + delay.
  bool lever = false;       ///< Camera centre from the centre of rotation, camera frame. [m]
  bool shutter = false;     ///< The image's last row is of so much later than its first: a rolling shutter.
  bool drift = false;       ///< fx and fy grow by so much of themselves a second: warmth, a focus that creeps.
  int errors = 0;           ///< Errors of the measured rotation, so many: RotationFrame::turn_by.
  bool learnt = false;    ///< fx, fy, cx, cy with which the points were estimated, before a zoom: they know nothing of
                          ///< the new ones.
  bool rotation = false;  ///< Error of the measured rotation, 3 angles; one per frame in a bundle, of now in a filter.
};

inline constexpr int max_common = 25 + max_rotation_errors;  ///< Of ObserveNuisances with everything.
using RotationErrors = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, max_rotation_errors, 1>;
using CommonVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, max_common, 1>;
using CommonMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, max_common, max_common>;
using PixelByCommon = Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, max_common>;

/// Where each parameter stands in a vector: fx, fy, cx, cy, then what else is estimated. −1: not there.
struct CommonLayout {
  explicit CommonLayout(const ObserveNuisances& nuisances);

  int size = 4;
  int k1 = -1, k2 = -1, k3 = -1, tangential = -1, mount = -1, delay = -1, lever = -1, shutter = -1, drift = -1,
      errors = -1, learnt = -1, rotation = -1;
  int num_errors = 0;
};

/// What all points have in common. Pixels are normalised (PixelScale), so are fx, fy, cx, cy.
struct RotatingCamera {
  Eigen::Vector4d k{1.0, 1.0, 0.0, 0.0};  ///< fx, fy, cx, cy.
  double k1 = 0.0, k2 = 0.0, k3 = 0.0, p1 = 0.0, p2 = 0.0;
  Eigen::Quaterniond cam_from_mount = Eigen::Quaterniond::Identity();
  double delay_s = 0.0;
  Eigen::Vector3d lever_m = Eigen::Vector3d::Zero();
  double shutter_s = 0.0;     ///< Pixels are of t + delay + shutter · v / image_height, v from the image centre.
  double image_height = 1.0;  ///< Normalised. Not estimated.
  double drift_per_s = 0.0;   ///< Of fx and fy, as a share; they are what k says at drift_from_s.
  double drift_from_s = 0.0;  ///< Not estimated.
  RotationErrors errors;      ///< mount_now = Exp(turn_by · errors) · measured; in units of their ordinary sizes.
  RotationErrors undone;      ///< What the measured rotation has been freed of before, in the same units.
  Eigen::Vector3d rotation_error_rad = Eigen::Vector3d::Zero();  ///< mount_now = Exp(rotation_error) · measured.

  /// fx, fy, cx, cy of an instant.
  [[nodiscard]] Eigen::Vector4d k_at(double t_s) const;
  /// The values moved by `step`, in the layout's order; the mount rotates on the right.
  [[nodiscard]] RotatingCamera retract(const CommonLayout& layout, const CommonVector& step) const;
};

/// A static point: bearing start_from_point · (a, b, 1) seen from the camera at the segment's start, over its depth.
/// start_from_point is fixed where the point is first met, so that a, b stay small on a full turn.
struct BearingPoint {
  Eigen::Matrix3d start_from_point = Eigen::Matrix3d::Identity();
  Eigen::Vector2d ab = Eigen::Vector2d::Zero();
  double inverse_depth = 0.0;  ///< [1/m]; 0: far away.

  [[nodiscard]] Eigen::Vector3d ray() const { return start_from_point * Eigen::Vector3d(ab.x(), ab.y(), 1.0); }
};

/// Pixel of a point with its derivatives. J_px_point: by a, b and the inverse depth.
struct RotationPrediction {
  Eigen::Vector2d px;
  PixelByCommon J_px_common;
  Eigen::Matrix<double, 2, 3> J_px_point;
};

/// The camera at one frame: what does not depend on the point.
class RotationView {
 public:
  RotationView(const RotatingCamera& camera, const RotationFrame& frame);

  /// Normalised pixel of a point; none behind the camera or beyond the fold of the lens.
  /// p ~ K D(C R Cᵀ (m + χ r) + χ (t − r)): R the measured rotation, C the mount, r the lever arm, t the shift. With a
  /// rolling shutter R is that of the pixel's own row.
  [[nodiscard]] std::optional<Eigen::Vector2d> project(const BearingPoint& point) const;
  [[nodiscard]] bool predict(const BearingPoint& point, const CommonLayout& layout, RotationPrediction& out) const;
  /// Ray of the pixel in the start's frame, for a point far away.
  [[nodiscard]] std::optional<Eigen::Vector3d> ray_in_start(const Eigen::Vector2d& px) const;
  /// Point in the camera, times its inverse depth; the derivative by shared parameters, a, b and inverse depth.
  [[nodiscard]] Eigen::Vector3d point_in_cam(const BearingPoint& point) const;
  void point_jacobians(const BearingPoint& point, const CommonLayout& layout,
                       Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, max_common>& J_common,
                       Eigen::Matrix3d& J_point) const;

 private:
  /// To where the camera was so much after (before) the frame's rotation was measured.
  void turn_to(double late_s);
  /// To where it was when this point's row was read. False: the point has no pixel.
  bool turn_to_row_of(const BearingPoint& point);
  [[nodiscard]] std::optional<Eigen::Vector2d> project_at_once(const BearingPoint& point) const;
  bool predict_at_once(const BearingPoint& point, const CommonLayout& layout, RotationPrediction& out) const;
  bool predict_by_rows(const BearingPoint& point, const CommonLayout& layout, RotationPrediction& out) const;
  [[nodiscard]] Eigen::Vector3d turned(const BearingPoint& point) const;
  [[nodiscard]] double late_at_row(double v) const;

  const RotatingCamera& camera_;
  Eigen::Quaterniond measured_;
  Eigen::Vector3d measured_rate_, acceleration_, shift_m_;
  TurnByErrors turn_by_;
  Eigen::Matrix3d cam_from_mount_, mount_from_start_, cam_from_start_;
  Eigen::Vector3d rate_;
  Eigen::Vector4d k_;       ///< As they are at the frame's time,
  double growth_ = 1.0;     ///< f over that of drift_from_s,
  double elapsed_s_ = 0.0;  ///< since then.
};

/// σ of fx, fy, cx, cy at an instant, from the covariance of the shared parameters.
[[nodiscard]] Eigen::Vector4d sigma_k_at(const RotatingCamera& camera, const CommonLayout& layout,
                                         const CommonMatrix& cov, double t_s);

/// A rotation that takes (0, 0, 1) to the direction of `ray`.
[[nodiscard]] Eigen::Matrix3d rotation_to(const Eigen::Vector3d& ray);

}  // namespace alidade
