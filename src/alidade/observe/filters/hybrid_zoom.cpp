// How the hybrid observer distinguishes a zoom from noise, follows it, and detects its end.
#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "alidade/observe/filters/hybrid.h"

namespace alidade {
namespace {

constexpr int clearly_left = 6;      // degrees of freedom: an outlier frame cannot fit so many by chance
constexpr double zoom_memory = 0.8;  // weight of the past in the variance of the change per frame

}  // namespace

/// Variance that `frames` frames of zoom add to the shared parameters.
CommonVector HybridObserver::process_noise(const ArrowheadFilter& filter, double frames) const {
  CommonVector variance = CommonVector::Zero(filter.layout().size);
  const double sigma = config_.zoom_px / config_.scale.scale;
  variance.head<4>().setConstant(frames * sigma * sigma);
  return variance;
}

/// The same for the next frame, at the recent speed of the zoom.
CommonVector HybridObserver::zoom_process_noise() const {
  CommonVector variance = process_noise(filter_, 1.0);
  variance.head<4>() = variance.head<4>().cwiseMax(zoom_variance_);
  return variance;
}

void HybridObserver::learn_zoom_process_noise(const Eigen::Vector4d& k_before) {
  const Eigen::Vector4d step = filter_.camera().k - k_before;
  zoom_variance_ = zoom_memory * zoom_variance_ + (1.0 - zoom_memory) * step.cwiseAbs2();
}

/// Whether a frame that does not fit would fit another camera. Outside a zoom, two consecutive frames must fit the same
/// camera, or each one of its own too well for chance; during a zoom one frame suffices.
bool HybridObserver::is_zoom(const RotationFrame& frame) {
  const bool fits_another = reject_until_zoomed();
  const bool fits_clearly = fits_another && filter_.dof() - 4 >= clearly_left;
  if (has_candidate_ && !is_zooming_) {
    candidate_.predict(process_noise(candidate_, 1.0), 0.0);
    candidate_.observe(frame, px_);
    if (candidate_.dof() > 0 && candidate_.nis() <= chi2_quantile(candidate_.dof(), gate_z)) {
      filter_ = candidate_;  // the caller updates it with this frame
      begin_zoom();
      return true;
    }
  }
  const bool is_late = fits_another && !is_zooming_ && is_noticed_late();
  if (fits_clearly && (has_candidate_ || is_zooming_)) {
    begin_zoom();
    if (is_late) go_back(filter_, frame);
    jump(filter_, frame);
    return true;
  }
  has_candidate_ = fits_another;
  if (has_candidate_) {
    candidate_ = filter_;
    if (is_late) go_back(candidate_, frame);
    jump(candidate_, frame);
    candidate_.update();
  }
  return false;
}

/// Rejects the points that fit another camera worst, one by one, until the rest fits it: at most a fifth, as in an
/// outlier frame no points fit. Returns false, with none rejected, if there is no other camera.
bool HybridObserver::reject_until_zoomed() {
  const std::size_t seen = filter_.num_seen(), most = seen / 5;
  for (std::size_t out = 0;; ++out) {
    const int left = std::max(filter_.dof() - 4, 0);
    const ArrowheadFilter::Hypothesis zoomed = filter_.with_added_variance(process_noise(filter_, any_zoom));
    if (zoomed.nis <= (left > 0 ? chi2_quantile(left, gate_z) : 1.0)) return true;
    if (out >= most || !std::isfinite(zoomed.nis)) break;
    std::size_t worst = seen;
    double largest = -1.0;
    for (std::size_t i = 0; i < seen; ++i) {
      const double rest = filter_.is_rejected(i) ? -1.0 : filter_.left_over(i, zoomed);
      if (rest > largest) std::tie(largest, worst) = std::pair(rest, i);
    }
    if (worst == seen) break;
    filter_.set_rejected(worst, true);
  }
  for (std::size_t i = 0; i < seen; ++i) filter_.set_rejected(i, false);
  return false;
}

/// Whether the change is at most twice what a single frame reveals. Then it may have
/// been smaller in earlier frames, and affected the points of the filter already.
bool HybridObserver::is_noticed_late() {
  const double shown = chi2_quantile(filter_.dof(), gate_z) - filter_.dof();
  return filter_.nis() - filter_.with_added_variance(process_noise(filter_, any_zoom)).nis < 4.0 * shown;
}

/// Returns to the filter as it was at least one window ago, with this frame
/// observed: the later frames updated it with a camera that was changing already.
void HybridObserver::go_back(ArrowheadFilter& filter, const RotationFrame& frame) {
  if (!has_window_starts_) return;
  is_out_.assign(is_out_.size(), false);
  for (std::size_t i = 0; i < filter.num_seen(); ++i)
    is_out_[static_cast<std::size_t>(filter.seen_point(i))] = filter.is_rejected(i);
  filter = last_window_start_;
  filter.observe(frame, px_);
  for (std::size_t i = 0; i < filter.num_seen(); ++i)
    filter.set_rejected(i, is_out_[static_cast<std::size_t>(filter.seen_point(i))]);
}

/// Lets the intrinsics change as far as this frame requires, and no farther: process noise for a step of 70 px would
/// make a drift of 1 px as noisy as a single frame.
void HybridObserver::jump(ArrowheadFilter& filter, const RotationFrame& frame) const {
  const CommonVector step = filter.with_added_variance(process_noise(filter, any_zoom)).step;
  filter.remember_intrinsics();
  CommonVector variance = process_noise(filter, 4.0);
  variance.head<4>() += step.head<4>().cwiseAbs2();
  filter.predict(variance, 0.0);
  filter.observe_again(frame, px_);
}

void HybridObserver::begin_zoom() {
  if (!is_zooming_) {
    past_count_ = 0;
    zoom_variance_.setZero();
    note_constant_span();
    frames_to_settle_ = 0;
  }
  is_zooming_ = true;
  drift_frames_ = 0;
  is_coarse_ = false;  // earlier frames are of another camera, and the points are known already
  buffer_.clear();
}

/// Whether the estimates of the last frames differ by no more than their noise.
bool HybridObserver::has_zoom_ended() {
  const Eigen::Vector4d now = filter_.camera().k;
  const Eigen::Vector4d before = past_k_[static_cast<std::size_t>(past_count_ % settled_frames)];
  past_k_[static_cast<std::size_t>(past_count_ % settled_frames)] = now;
  if (past_count_++ < settled_frames) return false;
  if ((zoom_variance_.array() > 4.0 * process_noise(filter_, 1.0).head<4>().array()).any()) return false;
  return ((now - before).cwiseAbs().array() < unseen_change().array()).all();
}

/// Largest difference of the settled frames' estimates that noise alone can explain.
Eigen::Vector4d HybridObserver::unseen_change() const {
  return 3.0 * std::sqrt(2.0) * filter_.covariance().diagonal().head<4>().cwiseSqrt();
}

/// A zoom may be so slow that it seems to have ended: changes are followed for twice as many frames more.
void HybridObserver::begin_settling() {
  frames_to_settle_ = 2 * settled_frames;
  settling_variance_ = (unseen_change() / settled_frames).cwiseAbs2();
}

void HybridObserver::settle_on(double t_s) {
  --frames_to_settle_;
  constant_since_s_ = t_s;
  CommonVector variance = CommonVector::Zero(filter_.layout().size);
  variance.head<4>() = settling_variance_;
  filter_.predict(variance, 0.0);
}

/// The intrinsics were constant until now, or until the frames that jointly showed a change.
void HybridObserver::note_constant_span() {
  const ConstantSpan span{constant_since_s_, std::max(constant_since_s_, std::min(last_fit_s_, drift_from_s_))};
  if (constant_spans_.size() == max_spans)
    constant_spans_.erase(std::ranges::min_element(constant_spans_, {}, &ConstantSpan::duration_s));
  constant_spans_.push_back(span);
}

HybridObserver::ConstantSpan HybridObserver::longest_constant_span() const {
  const std::vector<ConstantSpan> spans = constant_spans();
  // Among spans of equal length, the last.
  const auto longest = std::max_element(spans.rbegin(), spans.rend(), [](const ConstantSpan& a, const ConstantSpan& b) {
    return a.duration_s() < b.duration_s();
  });
  return longest == spans.rend() ? ConstantSpan{} : *longest;
}

std::vector<HybridObserver::ConstantSpan> HybridObserver::constant_spans() const {
  std::vector<ConstantSpan> spans = constant_spans_;
  if (is_running_ && !is_zooming_) spans.push_back({constant_since_s_, last_fit_s_, true});
  return spans;
}

}  // namespace alidade
