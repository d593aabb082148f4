#pragma once

#include "alidade/observe/filters/arrowhead_filter.h"
#include "alidade/observe/frame_buffer.h"

namespace alidade {

struct HybridConfig {
  std::size_t num_points = 0;
  PixelScale scale;
  ObserveNuisances nuisances;
  bool with_depth = false;
  RotatingCamera start;  ///< Initial guess, normalised.
  std::optional<CommonPrior> prior;
  bool no_zoom = false;         ///< No change is interpreted as a zoom.
  bool start_is_given = false;  ///< Otherwise several focal lengths are tried.
  double sigma_px = 0.0;        ///< [px]; 0: estimated from the residuals.
  double sigma_range_m = 0.0;   ///< σ of the ranges in the frames.
  std::size_t range_point = 0;
  double bootstrap_s = 1.0;
  std::size_t buffer_frames = 300;  ///< Number of frames kept for adjustments.
  /// σ_f / f below which frames are filtered, and a zoom is followed, instead of adjusting all frames again.
  double fine_enough = 1e-3;
  double zoom_px = 0.5;  ///< σ that one frame of zoom adds to each of fx, fy, cx, cy [px].
};

/// The default estimator for a rotating camera: a rotation bundle adjustment over the first second,
/// repeated while the result is still coarse, then an extended Kalman filter (ArrowheadFilter) that
/// tests each frame before its update: an outlier point is rejected (and after 15 frames
/// reinitialised), an outlier frame is skipped, a change of the intrinsics is followed, however fast.
/// It does not start while the focal length varies. If nothing fits for a second, it is reinitialised.
/// `step` allocates nothing after the adjustments are over (about 4 s). docs/maths/rotating-camera.md.
class HybridObserver {
 public:
  explicit HybridObserver(const HybridConfig& config);

  IntrinsicsEstimate step(const RotationFrame& frame);

  [[nodiscard]] const ArrowheadFilter& filter() const { return filter_; }
  [[nodiscard]] bool is_running() const { return is_running_; }
  /// σ of a pixel coordinate [px]: given, or estimated from the log so far.
  [[nodiscard]] double sigma_px() const { return config_.scale.scale * sigma_px_ * noise_ratio(); }
  /// The σ assumed by the filter, normalised: its covariance is in units of it.
  [[nodiscard]] double filter_sigma_px() const { return sigma_px_; }
  /// A time span in which the intrinsics were constant.
  struct ConstantSpan {
    double from_s = 0.0, until_s = 0.0;
    bool is_current = false;  ///< Lasts to the end, whether or not the last frames fit.
    [[nodiscard]] double duration_s() const { return until_s - from_s; }
    [[nodiscard]] bool contains(double t_s) const { return t_s >= from_s - 1e-9 && t_s <= until_s + 1e-9; }
  };
  /// The longest so far; of zero length if there is none.
  [[nodiscard]] ConstantSpan longest_constant_span() const;
  /// All spans in temporal order; if there are more than a few dozen, the longest ones.
  [[nodiscard]] std::vector<ConstantSpan> constant_spans() const;
  /// To be called at the end of the log: if the estimate is still coarse, adjusts all frames together.
  void settle();

 private:
  struct Judgement {
    ObserveEvent event = ObserveEvent::none;
    int point = -1;
    double nis = 0.0;
    int dof = 0;
    bool accept = true;
    bool is_adjusted = false;  ///< The frame is included in the filter by an adjustment of all frames.
  };

  void normalise(const RotationFrame& frame);
  void bootstrap(const RotationFrame& frame, IntrinsicsEstimate& estimate);
  bool adjust_buffer();
  void filter_frame(const RotationFrame& frame, IntrinsicsEstimate& estimate);
  void note_fit(double t_s, bool fits);
  [[nodiscard]] Judgement judge();
  bool reject_until(double gate_z, Judgement& judgement);
  [[nodiscard]] bool is_zoom(const RotationFrame& frame);
  bool reject_until_zoomed();
  void jump(ArrowheadFilter& filter, const RotationFrame& frame) const;
  [[nodiscard]] bool is_noticed_late();
  void go_back(ArrowheadFilter& filter, const RotationFrame& frame);
  void begin_zoom();
  [[nodiscard]] bool has_drifted(IntrinsicsEstimate& estimate);
  [[nodiscard]] int drifting_point() const;
  void reinitialise(std::size_t point);
  [[nodiscard]] bool has_zoom_ended();
  [[nodiscard]] Eigen::Vector4d unseen_change() const;
  void begin_settling();
  void settle_on(double t_s);
  void take_in(const RotationFrame& frame, const Judgement& judgement);
  [[nodiscard]] bool has_gained_much();
  void note_slips();
  void note_constant_span();
  void restart(IntrinsicsEstimate& estimate);
  [[nodiscard]] CommonVector process_noise(const ArrowheadFilter& filter, double frames) const;
  [[nodiscard]] CommonVector zoom_process_noise() const;
  void learn_zoom_process_noise(const Eigen::Vector4d& k_before);
  [[nodiscard]] double noise_ratio() const;
  void report(double t_s, IntrinsicsEstimate& estimate) const;

  static constexpr double gate_z = 3.09;   ///< One good frame in a thousand is rejected.
  static constexpr double any_zoom = 1e6;  ///< Frames of zoom added at once: hardly a prior on the intrinsics.
  static constexpr std::size_t max_spans = 32;
  static constexpr int settled_frames = 10;  ///< A zoom has ended after this many frames without change.

  HybridConfig config_;
  ArrowheadFilter filter_;
  FrameBuffer buffer_;
  std::vector<Eigen::Vector2d> px_;  ///< The pixels of this frame, normalised.
  std::vector<int> frames_out_;      ///< One per point: number of consecutive frames in which it was rejected,
  std::vector<int> patience_;        ///< and the number after which it is reinitialised.
  ArrowheadFilter candidate_;        ///< The filter under the hypothesis that the last frame was a zoom.
  bool has_candidate_ = false;
  ArrowheadFilter window_start_, last_window_start_;  ///< Filter at the start of this drift window and the last.
  bool has_window_starts_ = false;
  std::vector<bool> is_out_;  ///< One per point: rejected in this frame.
  bool is_coarse_ = true;     ///< The frames are still adjusted, not only filtered.
  bool is_running_ = false;
  double sigma_px_ = 0.0;  ///< Normalised.
  double next_adjustment_s_ = 0.0;
  double constant_since_s_ = 0.0, last_fit_s_ = 0.0;
  bool has_fit_ = true;         ///< Whether the last frame with pixels fitted;
  double unfit_since_s_ = 0.0;  ///< if not, the time since which none has.
  double drift_from_s_ = 0.0;   ///< Last frame before the current score window: a zoom may begin after it.
  Eigen::Vector4d rejected_step_ = Eigen::Vector4d::Zero();      ///< Step of fx, fy, cx, cy for a rejected frame.
  std::vector<ConstantSpan> constant_spans_;                     ///< Before the last change of the intrinsics.
  Eigen::Vector2d adjusted_variance_ = Eigen::Vector2d::Zero();  ///< Variance of fx, fy after the last adjustment.
  int frames_since_adjustment_ = 0;
  double sum_nis_ = 0.0, sum_dof_ = 0.0;  ///< Over the frames that fit: estimates the noise.
  bool is_zooming_ = false;
  Eigen::Vector4d zoom_variance_ = Eigen::Vector4d::Zero();      ///< Variance of the change per frame in a zoom.
  int frames_to_settle_ = 0;                                     ///< After its end, a zoom may still go on slowly,
  Eigen::Vector4d settling_variance_ = Eigen::Vector4d::Zero();  ///< with this variance per frame.
  std::array<Eigen::Vector4d, settled_frames> past_k_;
  int past_count_ = 0;
  struct Score {
    Eigen::Vector4d score = Eigen::Vector4d::Zero();
    Eigen::Matrix4d information = Eigen::Matrix4d::Zero();
  };
  Score drift_;
  std::vector<Score> point_drift_;  ///< One per point.
  int drift_frames_ = 0;
};

/// Quantile of χ² with `dof` degrees of freedom at the normal deviate `z` (3.09: 0.999). Wilson & Hilferty 1931.
[[nodiscard]] double chi2_quantile(int dof, double z);

}  // namespace alidade
