#pragma once

#include <cstdint>
#include <functional>

#include "alidade/pantilt/rotation_log.h"

namespace alidade {

/// Intrinsics at one instant. [px]
struct RotatingIntrinsics {
  double fx = 710.0, fy = 700.0, cx = 390.0, cy = 290.0;
  double k1 = 0.0;  ///< Radial terms, on coordinates over the focal length: (1 + k1 r² + k2 r⁴ + k3 r⁶).
  double k2 = 0.0, k3 = 0.0, p1 = 0.0, p2 = 0.0;  ///< Brown's convention.
};

/// A world for `observe`: a rotating camera, and static points.
struct RotationScene {
  int width_px = 780, height_px = 582;
  std::vector<Eigen::Vector2d> start_px;  ///< Pixels of the points at the start.
  std::vector<double> depth_m;            ///< Depth along the view at the start; empty: at infinity.
  /// Intrinsics as a function of time.
  std::function<RotatingIntrinsics(double t_s)> intrinsics = [](double) { return RotatingIntrinsics{}; };
  /// The rotation: angular rate in the camera frame for source `rate`, pan, tilt, roll for all others.
  std::function<Eigen::Vector3d(double t_s)> motion;
  Eigen::Vector3d lever_arm_m = Eigen::Vector3d::Zero();  ///< Camera centre from the centre of rotation, camera frame.
  Eigen::Vector3d mount_rad =
      Eigen::Vector3d::Zero();  ///< cam_from_mount = Exp(mount): the measured rotation is the mount's.
  double axes_skew_rad = 0.0;   ///< Skew of a head's tilt axis, about the view: base_from_cam_rotation().
  double delay_s = 0.0;         ///< Pixels are those at t + delay.
  double clock_rate = 0.0;  ///< The images' clock rate over the rotation's, minus 1: pixels at t · (1 + it) + delay.
  double shutter_s = 0.0;   ///< Time between reading the first and the last row; the central one is at t + delay.
};

struct RotationLogConfig {
  RotationSource source = RotationSource::rate;
  double rate_hz = 30.0;
  double duration_s = 20.0;
  double sigma_px = 0.31622776601683794;  ///< √0.1, as in the paper.
  double sigma_rate_rad_per_s = 0.0;      ///< White noise of each sample; source `rate`.
  double sigma_angle_rad = 0.0;           ///< White noise of each sample; other sources.
  Eigen::Vector3d rate_bias_rad_per_s = Eigen::Vector3d::Zero();
  double sigma_range_m = 0.0;
  bool with_range = false;     ///< Each row has the range of the first point.
  double lost_share = 0.0;     ///< Share of single pixels that are missing, at random.
  bool clip_to_image = false;  ///< Points outside the image are not observed; false: the image has no edge.
};

/// Faults of a log: of the measured rotation, and of the assignment of pixels to points.
struct RotationFaults {
  double angle_scale = 1.0;                              ///< Measured angle over the true one, for both axes.
  double backlash_rad = 0.0;                             ///< The camera lags behind the encoder by half of this.
  double once_a_turn_rad = 0.0, twice_a_turn_rad = 0.0;  ///< Amplitudes of the encoders' errors; phases are drawn.
  Eigen::Vector2d zero_drift_rad_per_s = Eigen::Vector2d::Zero();  ///< Drift of the zeros of pan and tilt.
  bool swaps_axes = false;
  Eigen::Vector2d signs = Eigen::Vector2d::Ones();  ///< Signs of pan and tilt.
  double wrong_share = 0.0;                         ///< Share of pixels at random positions in the image.
  double swapped_share = 0.0;                       ///< Share of pixels exchanged with another point's.
  double moving_share = 0.0;  ///< Share of points that move through the image, with a few up to 20 px/s.
  double noise_px = 0.0, noise_lasts_s = 0.0;  ///< Lasting noise of each track, beside the white one, and its duration.
  int missing_every = 0;   ///< The last of so many images is missing, and the numbers have no gap there. 0: none.
  int repeated_every = 0;  ///< The last of so many images repeats the one before it. 0: none.

  [[nodiscard]] bool are_of_rotation() const;
};

/// Adds faults to a log. Faults of angles need a head; σ of scale and parallax that would be wrong are removed.
void add_faults(const RotationFaults& faults, int width_px, int height_px, std::uint64_t seed, RotationLog& log);

/// The paper's motion: ω = (0.07 sin 0.8t, 0.12 sin 1.6t, 0) rad/s. Fang et al. 2011, eq. (27).
[[nodiscard]] Eigen::Vector3d paper_rate(double t_s);
/// The same oscillation as pan and tilt of a head about a mean tilt. [rad]
[[nodiscard]] Eigen::Vector3d paper_pan_tilt(double t_s, double mean_tilt_rad);

/// Draws `count` points in the image such that every triangle of them is at least 40 px high (two points: 40 px apart),
/// 60 px inside the edges. Same seed, same points.
[[nodiscard]] std::vector<Eigen::Vector2d> draw_points(int width_px, int height_px, int count, std::uint64_t seed);

/// Measurements in such a world, with the truth. Rotation is integrated in 64 steps per row. Same seed, same log, for
/// every compiler.
[[nodiscard]] RotationLog simulate_rotation(const RotationScene& scene, const RotationLogConfig& config,
                                            std::uint64_t seed);

}  // namespace alidade
