#include "alidade/observe/filters/hybrid.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "alidade/observe/filters/frame_variation.h"

namespace alidade {
namespace {

constexpr double zoom_gain = 33.4;  // χ²₄ at 10⁻⁶: a change of K must explain more than chance does
constexpr int slip_patience = 15;   // frames until a rejected point is reinitialised
constexpr double slipped_variance = 25.0;
constexpr double restart_after_s = 1.0;  // duration of frames that do not fit; a gap before them does not count
constexpr double longest_step_s = 0.25;
constexpr double better_by = 9.2;  // χ²₂ at 0.01
constexpr int drift_window = 15;   // frames
constexpr double finer_by = 0.75;  // of σ: gain of the filter since the last adjustment that triggers the next one
constexpr int between_adjustments = 5;  // frames

}  // namespace

double chi2_quantile(int dof, double z) {
  const double n = std::max(dof, 1), a = 2.0 / (9.0 * n);
  return n * std::pow(1.0 - a + z * std::sqrt(a), 3.0);
}

HybridObserver::HybridObserver(const HybridConfig& config)
    : config_(config),
      filter_(config.nuisances, config.with_depth, config.num_points),
      buffer_(config.num_points, config.buffer_frames),
      px_(config.num_points, Eigen::Vector2d::Constant(not_seen)),
      frames_out_(config.num_points, 0),
      patience_(config.num_points, slip_patience),
      candidate_(filter_),
      window_start_(filter_),
      last_window_start_(filter_),
      is_out_(config.num_points),
      point_drift_(config.num_points) {
  constant_spans_.reserve(max_spans);
}

void HybridObserver::normalise(const RotationFrame& frame) {
  for (std::size_t i = 0; i < px_.size(); ++i) {
    px_[i] = i < frame.px.size() ? config_.scale.normalised(frame.px[i]) : Eigen::Vector2d::Constant(not_seen);
  }
}

IntrinsicsEstimate HybridObserver::step(const RotationFrame& frame) {
  IntrinsicsEstimate estimate;
  normalise(frame);
  if (frame.starts_segment && buffer_.size() > 0) {
    buffer_.renew_all();
    filter_.forget_points();
    has_window_starts_ = false;
    estimate.event = ObserveEvent::new_segment;
  }
  rejected_step_.setZero();
  const bool sees = std::ranges::any_of(px_, is_seen);
  if (is_running_ && sees) filter_frame(frame, estimate);
  if (is_running_ && !sees && has_fit_) last_fit_s_ = frame.t_s;  // such a frame contains no information on the camera
  if (!is_running_ && sees) bootstrap(frame, estimate);
  if (is_running_) report(frame.t_s, estimate);
  return estimate;
}

void HybridObserver::bootstrap(const RotationFrame& frame, IntrinsicsEstimate& estimate) {
  if (buffer_.size() == 0) next_adjustment_s_ = frame.t_s + config_.bootstrap_s;
  buffer_.add(frame, px_);
  // A frame at 1 s is due in spite of rounding errors of its time.
  if (frame.t_s < next_adjustment_s_ - 1e-6) return;
  next_adjustment_s_ = frame.t_s + 0.5 * config_.bootstrap_s;
  if (!adjust_buffer()) return;
  is_running_ = true;
  last_fit_s_ = drift_from_s_ = frame.t_s;
  has_fit_ = true;
  constant_since_s_ = buffer_.frames().front().t_s;
  estimate.event = ObserveEvent::start;
}

bool HybridObserver::adjust_buffer() {
  AdjustConfig config;
  config.nuisances = config_.nuisances;
  config.with_depth = config_.with_depth;
  config.sigma_px = config_.sigma_px / config_.scale.scale;
  config.sigma_range_m = config_.sigma_range_m;
  config.range_point = config_.range_point;
  config.start = is_running_ ? filter_.camera() : config_.start;
  config.prior = config_.prior;
  if (!config_.start_is_given && !is_running_) config.other_starts = {0.7, 1.3, 2.5, 5.0, 10.0};
  Adjustment adjustment = adjust(buffer_, config);
  if (!adjustment.has_value && !is_running_ && config_.start_is_given) {
    config.other_starts = {0.7, 1.3, 2.5, 5.0, 10.0};  // the given initial guess may be far off
    adjustment = adjust(buffer_, config);
  }
  if (!adjustment.has_value) return false;
  if (!is_running_ && focal_variation_of(adjustment.bundle, adjustment.solution).is_significant()) {
    buffer_.erase_before(buffer_.frames().back().t_s - config_.bootstrap_s);  // waits for a second without zoom
    return false;
  }
  sigma_px_ = adjustment.sigma_px;
  filter_.start(adjustment.solution, adjustment.bundle_point_of, sigma_px_);
  sum_nis_ = sum_dof_ = std::max(adjustment.solution.dof, 1);
  drift_frames_ = 0;
  has_window_starts_ = false;
  const CommonMatrix& P = filter_.covariance();
  const Eigen::Vector4d& k = filter_.camera().k;
  is_coarse_ = std::max(std::sqrt(P(0, 0)) / k[0], std::sqrt(P(1, 1)) / k[1]) > config_.fine_enough;
  adjusted_variance_ = P.diagonal().head<2>();
  frames_since_adjustment_ = 0;
  return true;
}

void HybridObserver::filter_frame(const RotationFrame& frame, IntrinsicsEstimate& estimate) {
  const Eigen::Vector4d k_before = filter_.camera().k;
  if (is_zooming_) filter_.predict(zoom_process_noise(), 0.0);
  if (frames_to_settle_ > 0) settle_on(frame.t_s);
  filter_.observe(frame, px_);
  Judgement judgement = judge();
  if (judgement.event == ObserveEvent::burst && is_coarse_) {
    // The filter's linearisation is not accurate yet: all frames are adjusted together to judge this one.
    buffer_.add(frame, px_);
    if (adjust_buffer()) filter_.observe(frame, px_);
    judgement = judge();
    judgement.accept = judgement.is_adjusted = true;
    for (std::size_t i = 0; i < filter_.num_seen(); ++i) filter_.set_rejected(i, true);  // adjusted already
  }
  if (judgement.event == ObserveEvent::burst && !config_.no_zoom && is_zoom(frame)) {
    judgement.event = ObserveEvent::zoom;
    judgement.accept = true;
  }
  if (!std::isfinite(judgement.nis)) return restart(estimate);  // σ too small for floating point
  estimate.nis = judgement.nis;
  estimate.nis_dof = judgement.dof;
  estimate.point = judgement.point;
  if (estimate.event == ObserveEvent::none) estimate.event = judgement.event;
  note_fit(frame.t_s, judgement.accept);
  if (!judgement.accept) {
    // An outlier frame, or the first frame after a change of the camera: the next frame decides.
    const CommonVector step = filter_.with_added_variance(process_noise(filter_, any_zoom)).step;
    if (!config_.no_zoom && step.allFinite()) rejected_step_ = step.head<4>();
    if (frame.t_s - unfit_since_s_ > restart_after_s) restart(estimate);
    return;
  }
  has_candidate_ = false;
  if (!is_zooming_ && frames_to_settle_ == 0 && has_drifted(estimate) && !config_.no_zoom) {
    estimate.event = ObserveEvent::zoom;
    begin_zoom();
    go_back(filter_, frame);
    jump(filter_, frame);
  }
  take_in(frame, judgement);
  if (is_zooming_) learn_zoom_process_noise(k_before);
  if (is_zooming_ && has_zoom_ended()) {
    is_zooming_ = has_window_starts_ = false;
    constant_since_s_ = frame.t_s;
    begin_settling();
    estimate.event = ObserveEvent::zoom_end;
  }
}

void HybridObserver::note_fit(double t_s, bool fits) {
  if (has_fit_ && !fits) unfit_since_s_ = std::max(last_fit_s_, t_s - longest_step_s);
  has_fit_ = fits;
}

/// Tests the sum of the scores of the intrinsics over some frames, for a slow change that no single frame
/// reveals. If the change is explained by excluding one point, that point has moved and is reinitialised.
bool HybridObserver::has_drifted(IntrinsicsEstimate& estimate) {
  if (drift_frames_ == 0) {
    drift_from_s_ = last_fit_s_;
    last_window_start_ = has_window_starts_ ? window_start_ : filter_;
    window_start_ = filter_;
    has_window_starts_ = true;
    drift_ = {};
    std::fill(point_drift_.begin(), point_drift_.end(), Score{});
  }
  filter_.add_score(drift_.score, drift_.information);
  for (std::size_t i = 0; i < filter_.num_seen(); ++i) {
    Score& own = point_drift_[static_cast<std::size_t>(filter_.seen_point(i))];
    if (!filter_.is_rejected(i)) filter_.add_point_score(i, own.score, own.information);
  }
  if (++drift_frames_ < drift_window) return false;
  drift_frames_ = 0;
  const double statistic = drift_.score.dot(drift_.information.ldlt().solve(drift_.score));
  if (!(statistic > chi2_quantile(4, gate_z))) return false;
  const int point = drifting_point();
  const bool is_on_probation = point >= 0 && patience_[static_cast<std::size_t>(point)] > slip_patience;
  if (!is_on_probation && !(statistic > zoom_gain)) return false;
  if (point < 0) return !is_coarse_;
  estimate.event = ObserveEvent::slip;
  estimate.point = point;
  reinitialise(static_cast<std::size_t>(point));
  for (std::size_t i = 0; i < filter_.num_seen(); ++i) {
    if (filter_.seen_point(i) == point) filter_.set_rejected(i, true);
  }
  return false;
}

/// The point without which the scores of the window are within chance; −1: none.
int HybridObserver::drifting_point() const {
  Score all;
  for (const Score& own : point_drift_) {
    all.score += own.score;
    all.information += own.information;
  }
  int best = -1;
  double least = chi2_quantile(4, gate_z);
  for (std::size_t i = 0; i < point_drift_.size(); ++i) {
    if (point_drift_[i].information.isZero(0.0)) continue;
    const Eigen::Vector4d score = all.score - point_drift_[i].score;
    const Eigen::Matrix4d information = all.information - point_drift_[i].information;
    const Eigen::Matrix4d P = filter_.covariance().topLeftCorner<4, 4>();
    const double statistic = score.dot((information + information * P * information).ldlt().solve(score));
    if (!(statistic < least)) continue;
    least = statistic;
    best = static_cast<int>(i);
  }
  return best;
}

void HybridObserver::take_in(const RotationFrame& frame, const Judgement& judgement) {
  last_fit_s_ = frame.t_s;
  if (judgement.is_adjusted) return;  // no outlier points, and it is in the buffer already
  if (!is_zooming_) {
    sum_nis_ += judgement.nis;
    sum_dof_ += judgement.dof;
  }
  note_slips();
  filter_.update();
  if (frame.range_m > 0.0 && config_.with_depth) {
    filter_.update_range(frame, config_.range_point, frame.range_m, config_.sigma_range_m);
  }
  if (!is_coarse_) return;
  buffer_.add(frame, px_);
  if (frame.t_s < next_adjustment_s_ - 1e-6 && !has_gained_much()) return;
  next_adjustment_s_ = frame.t_s + std::max(0.5 * config_.bootstrap_s, 0.25 * buffer_.duration_s());
  adjust_buffer();
}

/// While it is coarse, the filter underestimates its covariance through errors of
/// linearisation: its gain of information is checked by an adjustment before it becomes large.
bool HybridObserver::has_gained_much() {
  if (++frames_since_adjustment_ < between_adjustments) return false;
  const Eigen::Vector2d variance = filter_.covariance().diagonal().head<2>();
  return (variance.array() < finer_by * finer_by * adjusted_variance_.array()).any();
}

void HybridObserver::note_slips() {
  for (std::size_t i = 0; i < filter_.num_seen(); ++i) {
    const auto point = static_cast<std::size_t>(filter_.seen_point(i));
    if (!filter_.is_rejected(i)) {
      frames_out_[point] = 0;
      continue;
    }
    px_[point].setConstant(not_seen);
    if (++frames_out_[point] >= patience_[point]) reinitialise(point);
  }
}

/// The point is reinitialised as a new one; if it is rejected again, after ever longer intervals.
void HybridObserver::reinitialise(std::size_t point) {
  filter_.forget_point(point);
  filter_.inflate_variance(point, slipped_variance);  // an outlier point may be moving still
  buffer_.renew_point(point);
  frames_out_[point] = 0;
  patience_[point] = std::min(4 * patience_[point], 10000);
}

void HybridObserver::settle() {
  if (is_running_ && is_coarse_) adjust_buffer();
}

void HybridObserver::restart(IntrinsicsEstimate& estimate) {
  if (!is_zooming_) note_constant_span();
  is_running_ = is_zooming_ = false;
  frames_to_settle_ = 0;
  has_candidate_ = false;
  buffer_.clear();
  estimate.event = ObserveEvent::restart;
}

double HybridObserver::noise_ratio() const {
  return config_.sigma_px > 0.0 || !(sum_dof_ > 0.0) ? 1.0 : std::sqrt(sum_nis_ / sum_dof_);
}

void HybridObserver::report(double t_s, IntrinsicsEstimate& estimate) const {
  const double scale = config_.scale.scale;
  const Eigen::Vector4d k = filter_.camera().k_at(t_s);
  estimate.has_value = true;
  estimate.fx = scale * k[0];
  estimate.fy = scale * k[1];
  estimate.cx = scale * k[2] + config_.scale.centre.x();
  estimate.cy = scale * k[3] + config_.scale.centre.y();
  estimate.k1 = filter_.camera().k1;
  estimate.sigma = scale * noise_ratio() * sigma_k_at(filter_.camera(), filter_.layout(), filter_.covariance(), t_s);
  estimate.sigma = (estimate.sigma.cwiseAbs2() + (scale * rejected_step_).cwiseAbs2()).cwiseSqrt();
}

HybridObserver::Judgement HybridObserver::judge() {
  Judgement judgement;
  judgement.dof = filter_.dof();
  judgement.nis = filter_.nis();
  if (judgement.dof == 0) return judgement;
  if (judgement.nis <= chi2_quantile(judgement.dof, gate_z)) return judgement;
  const double if_zoomed = filter_.with_added_variance(process_noise(filter_, any_zoom)).nis;
  if (reject_until(gate_z, judgement)) {
    // A change of the intrinsics moves all points, some slightly: if it explains much more, no point is an outlier.
    if (!(judgement.nis - if_zoomed > better_by)) return judgement;
    for (std::size_t i = 0; i < filter_.num_seen(); ++i) filter_.set_rejected(i, false);
    judgement.point = -1;
  }
  judgement.event = ObserveEvent::burst;
  judgement.accept = false;
  return judgement;
}

/// Rejects the worst points one by one until the rest fits (outlier points): at most a third of them,
/// or one of three or four. Returns false, with none rejected, if that does not explain the frame.
bool HybridObserver::reject_until(double z, Judgement& judgement) {
  const std::size_t seen = filter_.num_seen();
  const std::size_t most = seen < 3 ? 0 : std::max<std::size_t>(seen / 3, 1);
  for (std::size_t out = 0; out < most; ++out) {
    std::size_t worst = seen;
    double best = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < seen; ++i) {
      if (filter_.is_rejected(i)) continue;
      double without = -filter_.point_nis(i);  // many points: instead, the one with the largest NIS of its own
      if (seen <= 12) {
        filter_.set_rejected(i, true);
        without = filter_.nis();
        filter_.set_rejected(i, false);
      }
      if (without < best) {
        best = without;
        worst = i;
      }
    }
    filter_.set_rejected(worst, true);
    judgement.point = filter_.seen_point(worst);
    judgement.nis = filter_.nis();
    judgement.dof = filter_.dof();
    if (judgement.nis <= chi2_quantile(judgement.dof, z)) {
      judgement.event = ObserveEvent::slip;
      return true;
    }
  }
  for (std::size_t i = 0; i < seen; ++i) filter_.set_rejected(i, false);
  judgement.nis = filter_.nis();
  judgement.dof = filter_.dof();
  judgement.point = -1;
  return false;
}

}  // namespace alidade
