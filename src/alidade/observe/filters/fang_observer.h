#pragma once

#include <optional>
#include <vector>

#include "alidade/observe/config.h"
#include "alidade/observe/filters/difference_filter.h"
#include "alidade/observe/filters/running_gramian.h"
#include "alidade/observe/rotation_frame.h"

namespace alidade {

/// Gains of the observer with constant gain.
struct FangGains {
  double k1 = 0.0;          ///< Gain of ξ [1/s].
  double gain = 0.0;        ///< Γ = gain · Ḡ⁻¹.
  double lowpass_hz = 0.0;  ///< Cut-off of the low-pass on both sides of the regression; 0: none.
};

/// The gains of the profiles `fast` and `quiet`.
[[nodiscard]] FangGains gains_of(FangProfile profile);

/// Limits of gramian_lambda_min() below which the observer refuses an estimate, or warns.
inline constexpr double fang_refuse_lambda = 1e-4, fang_warn_lambda = 3e-4;

struct FangConfig {
  std::size_t num_points = 0;  ///< Number of pixels in each frame.
  PixelScale scale;
  FangProfile profile = FangProfile::quiet;
  Eigen::Vector4d start{1.0, 1.0, 0.0, 0.0};  ///< Initial fx, fy, cx, cy [px].
  /// Two more columns for the rotation about the optical axis, which a pan-over-tilt head has unless its tilt is zero.
  bool roll_columns = true;
  /// Uses the rates measured at both ends of a step, as the paper would, instead of the mean
  /// rate over the step. At 30 Hz this costs 0.2 px in fx, the error of the trapezoid rule.
  bool rates_at_ends = false;
  /// Reference point of the differences while it is seen; none: the point nearest the centre of the image.
  std::optional<std::size_t> reference_point;
  std::optional<FangGains> gains;  ///< Replace those of the profile.
  /// Ḡ, the mean of ΩΩᵀ, if known beforehand. Otherwise a typical one is used for the first `excitation_period_s`, and
  /// after that the one of the actual points and motion.
  std::optional<Eigen::Matrix<double, 8, 8>> mean_gramian;
  double excitation_period_s = 7.854;
  // For profile kalman only.
  double sigma_px = 0.3;                                          ///< σ of one coordinate of one point.
  double prior_sigma_f_px = 200.0, prior_sigma_centre_px = 50.0;  ///< σ of `start`.
  /// Added to the variance of each θ: the prior above is linearised at `start`, and a tight one could never be left.
  double prior_floor = 1e-6;
  double drift_px_per_sqrt_s = 0.0219;  ///< Random walk of each ξ: 10⁻⁵ scaled pixels at 30 Hz.
};

/// The intrinsics observer of Fang, Liu, Li & Zhang, "A global exponential observer for camera calibration", 2011, eqs.
/// (14)–(25), with errata corrected and columns for ω_z added: differences y_i = q_i − q_reference in scaled pixels,
/// ẏ = Ωᵀθ,
///
///   ξ̂̇ = Ωᵀθ̂ + k1 e,  θ̂̇ = Γ Ω e,  e = y − ξ̂,
///
/// by the implicit midpoint rule, for which V = |e|² + θ̃ᵀΓ⁻¹θ̃ decreases by 2h k1|e_m|² per step for any gain and step
/// length. Needs undistorted pixels, points far apart, persistent excitation by ω_x and ω_y, and constant intrinsics.
/// Allocates nothing after construction.
class FangObserver {
 public:
  explicit FangObserver(const FangConfig& config);

  /// No value until both 1/fx and 1/fy exceed 1/20 in scaled pixels. σ is NaN except for `kalman`. A point
  /// that was not seen is reinitialised where it is seen next; likewise all points at the start of a
  /// segment and when the reference is lost. θ is kept. A frame with a time step of zero changes nothing.
  IntrinsicsEstimate step(const RotationFrame& frame);

  /// Smallest eigenvalue of ∫ΩΩᵀ dt over the last eight seconds; see the limits above.
  [[nodiscard]] double gramian_lambda_min() const { return gramian_.lambda_min(); }

  [[nodiscard]] const DifferenceParameters& theta() const;
  /// e of a point in the last frame, scaled; zero for `kalman`.
  [[nodiscard]] Eigen::Vector2d error(std::size_t point) const { return points_[point].y - points_[point].xi; }

 private:
  using Matrix8 = Eigen::Matrix<double, 8, 8>;
  struct Point {
    bool is_live = false;   // the point and the reference were seen in the frame before
    bool is_moved = false;  // live, and seen in this frame
    Eigen::Vector2d q = Eigen::Vector2d::Zero();
    Eigen::Vector2d unfiltered = Eigen::Vector2d::Zero();
    Eigen::Vector2d y = Eigen::Vector2d::Zero();  // low-passed, if there is a low-pass; so is `filtered`
    DifferenceRegressor filtered = DifferenceRegressor::Zero();
    Eigen::Vector2d xi = Eigen::Vector2d::Zero();
    // Midpoint values of the step, and the result of the midpoint rule.
    DifferenceRegressor omega = DifferenceRegressor::Zero();
    Eigen::Vector2d y_mid = Eigen::Vector2d::Zero(), e_mid = Eigen::Vector2d::Zero();
  };

  [[nodiscard]] bool choose_reference(const RotationFrame& frame);
  void take_step(const RotationFrame& frame);
  void filter_kalman(const RotationFrame& frame);
  void add_to_gramians(double h);
  void low_pass(Point& point, const Eigen::Vector2d& y, double h) const;
  void midpoint_step(double h);
  void set_gain(const Matrix8& mean_gramian);
  [[nodiscard]] IntrinsicsEstimate estimate(ObserveEvent event) const;

  FangConfig config_;
  FangGains gains_;
  std::vector<Point> points_;
  std::size_t reference_ = 0;
  bool has_reference_ = false, has_begun_ = false, has_started_ = false;
  Eigen::Vector3d last_rate_ = Eigen::Vector3d::Zero();
  DifferenceParameters theta_;
  Matrix8 gamma_, gamma_inverse_;
  Matrix8 first_gramian_ = Matrix8::Zero();  // over the first excitation period
  double first_s_ = 0.0;
  bool has_own_gain_ = false;
  RunningGramian gramian_;
  std::optional<DifferenceFilter> kalman_;
  int nis_dof_ = 0;  // of this frame
};

}  // namespace alidade
