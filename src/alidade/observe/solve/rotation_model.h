#pragma once

#include <Eigen/Geometry>
#include <optional>

#include "alidade/observe/rotation_frame.h"

namespace alidade {

/// The parameters that are estimated in addition to fx, fy, cx, cy.
struct ObserveNuisances {
  bool k1 = false;  ///< Radial distortion: x (1 + k1 r² + k2 r⁴ + k3 r⁶) on coordinates over the focal length.
  bool k2 = false;
  bool k3 = false;
  bool tangential = false;  ///< p1, p2 as defined by Brown.
  bool mount = false;       ///< Rotation from the frame whose rotation is measured to the camera frame, 3 angles.
  bool delay = false;       ///< Pixels are of time t + delay.
  bool lever = false;       ///< Camera centre relative to the centre of rotation, camera frame [m].
  bool shutter = false;     ///< Rolling shutter: delay of the last row of the image after the first [s].
  bool drift = false;       ///< Relative growth of fx and fy per second: thermal drift or focus creep.
  int errors = 0;           ///< Number of errors of the measured rotation: RotationFrame::turn_by.
  bool learnt = false;      ///< fx, fy, cx, cy with which the points were estimated before a zoom: they say nothing
                            ///< about the new ones.
  bool rotation = false;  ///< Error of the measured rotation, 3 angles; one per frame in a bundle, latest in a filter.
};

inline constexpr int max_common = 25 + max_rotation_errors;  ///< For ObserveNuisances with everything.
using RotationErrors = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, max_rotation_errors, 1>;
using CommonVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, max_common, 1>;
using CommonMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, max_common, max_common>;
using PixelByCommon = Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, max_common>;

/// Index of each parameter in a vector: fx, fy, cx, cy, then the others that are estimated. −1: not estimated.
struct CommonLayout {
  explicit CommonLayout(const ObserveNuisances& nuisances);

  int size = 4;
  int k1 = -1, k2 = -1, k3 = -1, tangential = -1, mount = -1, delay = -1, lever = -1, shutter = -1, drift = -1,
      errors = -1, learnt = -1, rotation = -1;
  int num_errors = 0;
};

/// The parameters that all points share. Pixels and fx, fy, cx, cy are normalised (PixelScale).
struct RotatingCamera {
  Eigen::Vector4d k{1.0, 1.0, 0.0, 0.0};  ///< fx, fy, cx, cy.
  double k1 = 0.0, k2 = 0.0, k3 = 0.0, p1 = 0.0, p2 = 0.0;
  Eigen::Quaterniond cam_from_mount = Eigen::Quaterniond::Identity();
  double delay_s = 0.0;
  Eigen::Vector3d lever_m = Eigen::Vector3d::Zero();
  double shutter_s = 0.0;     ///< Pixels are of t + delay + shutter · v / image_height, v from the image centre.
  double image_height = 1.0;  ///< Normalised. Not estimated.
  double drift_per_s = 0.0;   ///< Relative growth of fx and fy; at drift_from_s they are as in k.
  double drift_from_s = 0.0;  ///< Not estimated.
  RotationErrors errors;      ///< mount_now = Exp(turn_by · errors) · measured; in units of their typical sizes.
  RotationErrors undone;      ///< Errors that the measured rotation was already corrected for, same units.
  Eigen::Vector3d rotation_error_rad = Eigen::Vector3d::Zero();  ///< mount_now = Exp(rotation_error) · measured.

  /// fx, fy, cx, cy at time `t_s`.
  [[nodiscard]] Eigen::Vector4d k_at(double t_s) const;
  /// The camera after a `step` in the layout's order; the mount is perturbed on the right.
  [[nodiscard]] RotatingCamera retract(const CommonLayout& layout, const CommonVector& step) const;
};

/// A static point: bearing start_from_point · (a, b, 1) relative to the camera at the start of the segment, and inverse
/// depth. start_from_point is fixed when the point is first seen, so that a, b stay small over a full rotation.
struct BearingPoint {
  Eigen::Matrix3d start_from_point = Eigen::Matrix3d::Identity();
  Eigen::Vector2d ab = Eigen::Vector2d::Zero();
  double inverse_depth = 0.0;  ///< [1/m]; 0: at infinity.

  [[nodiscard]] Eigen::Vector3d ray() const { return start_from_point * Eigen::Vector3d(ab.x(), ab.y(), 1.0); }
};

/// Pixel of a point with its derivatives. J_px_point: by a, b and inverse depth.
struct RotationPrediction {
  Eigen::Vector2d px;
  PixelByCommon J_px_common;
  Eigen::Matrix<double, 2, 3> J_px_point;
};

/// The camera at one frame: all quantities that do not depend on the point.
class RotationView {
 public:
  RotationView(const RotatingCamera& camera, const RotationFrame& frame);

  /// Normalised pixel of a point; none behind the camera or beyond the fold of the lens.
  /// p ~ K D(C R Cᵀ (m + χ r) + χ (t − r)): R the measured rotation, C the mount, r the lever arm, t the shift. With a
  /// rolling shutter, R is that of the pixel's own row.
  [[nodiscard]] std::optional<Eigen::Vector2d> project(const BearingPoint& point) const;
  [[nodiscard]] bool predict(const BearingPoint& point, const CommonLayout& layout, RotationPrediction& out) const;
  /// Ray of a pixel in the start frame, for a point at infinity.
  [[nodiscard]] std::optional<Eigen::Vector3d> ray_in_start(const Eigen::Vector2d& px) const;
  /// Point in the camera frame times its inverse depth; derivatives by shared parameters, a, b and inverse depth.
  [[nodiscard]] Eigen::Vector3d point_in_cam(const BearingPoint& point) const;
  void point_jacobians(const BearingPoint& point, const CommonLayout& layout,
                       Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, max_common>& J_common,
                       Eigen::Matrix3d& J_point) const;

 private:
  /// Moves the view to `late_s` after the time at which the frame's rotation was measured.
  void turn_to(double late_s);
  /// Moves the view to the time at which the row of this point was read. False: the point has no pixel.
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
  Eigen::Vector4d k_;       ///< At the time of the frame.
  double growth_ = 1.0;     ///< f over f at drift_from_s.
  double elapsed_s_ = 0.0;  ///< Time since drift_from_s.
};

/// σ of fx, fy, cx, cy at time `t_s`, from the covariance of the shared parameters.
[[nodiscard]] Eigen::Vector4d sigma_k_at(const RotatingCamera& camera, const CommonLayout& layout,
                                         const CommonMatrix& cov, double t_s);

/// A rotation that maps (0, 0, 1) to the direction of `ray`.
[[nodiscard]] Eigen::Matrix3d rotation_to(const Eigen::Vector3d& ray);

}  // namespace alidade
