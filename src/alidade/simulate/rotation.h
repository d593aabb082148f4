#pragma once

#include <cstdint>
#include <functional>

#include "alidade/pantilt/rotation_log.h"

namespace alidade {

/// Intrinsics at an instant. [px]
struct RotatingIntrinsics {
  double fx = 710.0, fy = 700.0, cx = 390.0, cy = 290.0;
  double k1 = 0.0;  ///< Radial, on coordinates over the focal length: (1 + k1 r² + k2 r⁴ + k3 r⁶).
  double k2 = 0.0, k3 = 0.0, p1 = 0.0, p2 = 0.0;  ///< As Brown has them.
};

/// A world for `observe`: a rotating camera, and static points.
struct RotationScene {
  int width_px = 780, height_px = 582;
  std::vector<Eigen::Vector2d> start_px;  ///< Where the points are seen at the start.
  std::vector<double> depth_m;            ///< Along the view at the start; empty: far away.
  /// Intrinsics, as they change with time.
  std::function<RotatingIntrinsics(double t_s)> intrinsics = [](double) { return RotatingIntrinsics{}; };
  /// How it rotates: angular rate in the camera frame for source `rate`, pan, tilt, roll for all others.
  std::function<Eigen::Vector3d(double t_s)> motion;
  Eigen::Vector3d lever_arm_m = Eigen::Vector3d::Zero();  ///< Camera centre from the centre of rotation, camera frame.
  Eigen::Vector3d mount_rad =
      Eigen::Vector3d::Zero();  ///< cam_from_mount = Exp(mount): what is measured is the mount's.
  double axes_skew_rad = 0.0;   ///< Of a head's tilt axis, about the view: base_from_cam_rotation().
  double delay_s = 0.0;         ///< Pixels are of t + delay.
  double clock_rate = 0.0;  ///< The images' clock over the rotation's, less one: pixels are of t · (1 + it) + delay.
  double shutter_s = 0.0;   ///< The last row is read so much after the first; the central one at t + delay.
};

struct RotationLogConfig {
  RotationSource source = RotationSource::rate;
  double rate_hz = 30.0;
  double duration_s = 20.0;
  double sigma_px = 0.31622776601683794;  ///< √0.1: the paper's.
  double sigma_rate_rad_per_s = 0.0;      ///< White, of each sample; source `rate`.
  double sigma_angle_rad = 0.0;           ///< White, of each sample; the others.
  Eigen::Vector3d rate_bias_rad_per_s = Eigen::Vector3d::Zero();
  double sigma_range_m = 0.0;
  bool with_range = false;     ///< Range of the first point in every row.
  double lost_share = 0.0;     ///< Share of single pixels not seen, by chance.
  bool clip_to_image = false;  ///< Points outside the image are not seen; otherwise the image has no edge.
};

/// What may be wrong with a log: with how the rotation is measured, and with which pixel is whose.
struct RotationFaults {
  double angle_scale = 1.0;                              ///< Measured over true, of both axes.
  double backlash_rad = 0.0;                             ///< The camera lags behind the encoder by half of it.
  double once_a_turn_rad = 0.0, twice_a_turn_rad = 0.0;  ///< Amplitudes of the encoders' error; phases drawn.
  Eigen::Vector2d zero_drift_rad_per_s = Eigen::Vector2d::Zero();  ///< Of pan and tilt.
  bool swaps_axes = false;
  Eigen::Vector2d signs = Eigen::Vector2d::Ones();  ///< Of pan and tilt.
  double wrong_share = 0.0;                         ///< Pixels that are anywhere in the image.
  double swapped_share = 0.0;                       ///< Pixels exchanged with another point's.
  double moving_share = 0.0;  ///< Points that move through the image, by a few pixels a second, up to 20.
  double noise_px = 0.0, noise_lasts_s = 0.0;  ///< Noise of each track beside the white one, and how long it lasts.
  int missing_every = 0;  ///< Of so many images the last is missing, and those behind it are numbered through. 0: none.
  int repeated_every = 0;  ///< Of so many images the last is the one before it once more. 0: none.

  [[nodiscard]] bool are_of_rotation() const;
};

/// The log with these faults. Heads alone have those of angles; σ of scale and parallax, if wrong, are no longer given.
void add_faults(const RotationFaults& faults, int width_px, int height_px, std::uint64_t seed, RotationLog& log);

/// The paper's motion: ω = (0.07 sin 0.8t, 0.12 sin 1.6t, 0) rad/s. Fang et al. 2011, eq. (27).
[[nodiscard]] Eigen::Vector3d paper_rate(double t_s);
/// The same sway as pan and tilt of a head about a mean tilt. [rad]
[[nodiscard]] Eigen::Vector3d paper_pan_tilt(double t_s, double mean_tilt_rad);

/// `count` points in the image such that every triangle among them is at least 40 px high (for two points: 40 px
/// apart), 60 px inside the edges. Same seed, same points.
[[nodiscard]] std::vector<Eigen::Vector2d> draw_points(int width_px, int height_px, int count, std::uint64_t seed);

/// What is measured in such a world, with its truth. Rotation is integrated 64 times finer than the rows. Same seed,
/// same log, whatever the compiler.
[[nodiscard]] RotationLog simulate_rotation(const RotationScene& scene, const RotationLogConfig& config,
                                            std::uint64_t seed);

}  // namespace alidade
