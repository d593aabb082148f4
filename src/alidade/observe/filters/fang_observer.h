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
  double k1 = 0.0;          ///< Of ξ. [1/s]
  double gain = 0.0;        ///< Γ = gain · Ḡ⁻¹.
  double lowpass_hz = 0.0;  ///< Of both sides of the regression; 0: none.
};

/// Those of `fast` or `quiet`.
[[nodiscard]] FangGains gains_of(FangProfile profile);

/// What the observer can be trusted with, by gramian_lambda_min().
inline constexpr double fang_refuse_lambda = 1e-4, fang_warn_lambda = 3e-4;

struct FangConfig {
  std::size_t num_points = 0;  ///< Every frame has this many pixels.
  PixelScale scale;
  FangProfile profile = FangProfile::quiet;
  Eigen::Vector4d start{1.0, 1.0, 0.0, 0.0};  ///< fx, fy, cx, cy to begin with. [px]
  /// Two more columns for the rotation about the axis of view, which a pan-over-tilt head has but at zero tilt.
  bool roll_columns = true;
  /// The regression takes the rates measured at both ends of a step, as the paper would, not their mean over it. At 30
  /// Hz that costs fx 0.2 px, the error of the trapezoid rule.
  bool rates_at_ends = false;
  /// The point that differences are taken to, while it is seen; otherwise the one nearest the image's centre.
  std::optional<std::size_t> reference_point;
  std::optional<FangGains> gains;  ///< Instead of the profile's.
  /// Ḡ, the mean of ΩΩᵀ, where it is known beforehand. Otherwise a typical one serves until `excitation_period_s` has
  /// gone by, and from then on that of the points and the motion there were.
  std::optional<Eigen::Matrix<double, 8, 8>> mean_gramian;
  double excitation_period_s = 7.854;
  // Profile kalman alone.
  double sigma_px = 0.3;                                          ///< Of one coordinate of one point.
  double prior_sigma_f_px = 200.0, prior_sigma_centre_px = 50.0;  ///< Of the start.
  /// Added to the variance of each θ: the prior above is linearised at the start, and a tight one holds to it for ever.
  double prior_floor = 1e-6;
  double drift_px_per_sqrt_s = 0.0219;  ///< Random walk of each ξ: 10⁻⁵ scaled pixels at 30 Hz.
};

/// The intrinsics observer of Fang, Liu, Li & Zhang, "A global exponential observer for camera calibration", 2011, eqs.
/// (14)–(25), with its errata corrected and ω_z columns added: differences y_i = q_i − q_reference in scaled pixels,
/// ẏ = Ωᵀθ,
///
///   ξ̂̇ = Ωᵀθ̂ + k1 e,  θ̂̇ = Γ Ω e,  e = y − ξ̂,
///
/// by the implicit midpoint rule, for which V = |e|² + θ̃ᵀΓ⁻¹θ̃ falls by 2h k1|e_m|² a step at every gain and step
/// length. Needs undistorted pixels, points far apart, ω_x and ω_y that both keep coming, and intrinsics that do not
/// change. Allocates nothing after construction.
class FangObserver {
 public:
  explicit FangObserver(const FangConfig& config);

  /// No value until both 1/fx and 1/fy have come above 1/20 in scaled pixels. σ is NaN but for `kalman`. A point that
  /// was not seen begins again where it is seen next; so do all at the start of a segment and when the reference is
  /// lost. θ stays. A frame without a step in time changes nothing.
  IntrinsicsEstimate step(const RotationFrame& frame);

  /// Least eigenvalue of ∫ΩΩᵀ dt over the last eight seconds; see the limits above.
  [[nodiscard]] double gramian_lambda_min() const { return gramian_.lambda_min(); }

  [[nodiscard]] const DifferenceParameters& theta() const;
  /// e of a point at the last frame, scaled; zero for `kalman`.
  [[nodiscard]] Eigen::Vector2d error(std::size_t point) const { return points_[point].y - points_[point].xi; }

 private:
  using Matrix8 = Eigen::Matrix<double, 8, 8>;
  struct Point {
    bool is_live = false;   // seen in the frame before, as was the reference
    bool is_moved = false;  // live, and seen now
    Eigen::Vector2d q = Eigen::Vector2d::Zero();
    Eigen::Vector2d unfiltered = Eigen::Vector2d::Zero();
    Eigen::Vector2d y = Eigen::Vector2d::Zero();  // behind the low pass, if there is one; so is `filtered`
    DifferenceRegressor filtered = DifferenceRegressor::Zero();
    Eigen::Vector2d xi = Eigen::Vector2d::Zero();
    // Of the step: midpoint values, and what the midpoint rule gives.
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
