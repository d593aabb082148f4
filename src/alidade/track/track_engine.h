#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "alidade/track/tracker.h"

namespace alidade::detail {

/// The tracker for one kind of filter: keeps the last observations and the beliefs after them, in order of capture, so
/// that a late observation is inserted at its time and everything after it is recomputed.
template <class Filter>
class TrackEngine {
 public:
  using Models = typename Filter::Models;

  TrackEngine(std::vector<RigHead> heads, const TrackerConfig& config, const Models& models)
      : heads_(std::move(heads)), config_(config), models_(models), kept_(std::max<std::size_t>(8, config.max_kept)) {}

  TrackStep take(const TargetObservation& observation) {
    if (!is_in_image(observation)) return rejected(TrackEvent::outside);
    std::size_t place = count_;
    while (place > 0 && entry(place - 1).observation.t_capture_s > observation.t_capture_s) --place;
    const bool is_late =
        place < count_ && (newest().observation.t_capture_s - observation.t_capture_s > config_.history_s ||
                           (place == 0 && has_forgotten_));
    if (is_late) return rejected(TrackEvent::late);
    place -= make_room(place);
    for (std::size_t i = count_; i > place; --i) entry(i) = entry(i - 1);
    const bool had_started = count_ > 0 && newest().has_started;
    ++count_;
    entry(place).observation = observation;
    TrackStep step;
    apply(place, step);
    for (std::size_t i = place + 1; i < count_; ++i) {
      TrackStep again;
      apply(i, again);
      // An observation that arrived earlier but was captured later may have waited for this one.
      if (!had_started && again.event == TrackEvent::start) {
        step.event = TrackEvent::start;
        step.accepted = true;
      }
    }
    report_newest(step);
    return step;
  }

  [[nodiscard]] std::optional<Belief<6>> at(double t_s) const {
    if (count_ == 0 || !newest().has_started || !(t_s >= newest().observation.t_capture_s)) return std::nullopt;
    Filter filter = newest().filter;
    filter.predict(models_, t_s - newest().observation.t_capture_s);
    Belief<6> belief = filter.estimate();
    count_range_drift(newest(), t_s, belief);
    return belief;
  }

  [[nodiscard]] std::optional<Tracker::Smoothed> smoothed(double lag_s) const {
    if constexpr (Filter::can_smooth) {
      if (count_ == 0 || !newest().has_started) return std::nullopt;
      Filter filter = newest().filter;
      std::size_t i = count_ - 1;
      while (newest().observation.t_capture_s - entry(i).observation.t_capture_s < lag_s) {
        if (i == 0 || entry(i).began || !entry(i - 1).has_started) return std::nullopt;
        filter = entry(i - 1).filter.smoothed(models_, filter,
                                              entry(i).observation.t_capture_s - entry(i - 1).observation.t_capture_s);
        --i;
      }
      return Tracker::Smoothed{entry(i).observation.t_capture_s, filter.estimate()};
    } else {
      return std::nullopt;
    }
  }

  [[nodiscard]] std::optional<Tracker::Learned> learned() const {
    if constexpr (requires(const Filter& filter) { filter.errors.u; }) {
      if (count_ > 0 && newest().has_started)
        return Tracker::Learned{newest().filter.errors.u, newest().filter.errors.C};
    }
    return std::nullopt;
  }

 private:
  /// An observation, and the state after it.
  struct Entry {
    TargetObservation observation;
    Filter filter;
    bool has_started = false;
    bool began = false;     ///< The track starts, or restarts, here.
    bool accepted = false;  ///< The observation was used for the update.
    /// Consecutive rejections per head: counted together, a head that keeps failing would
    /// be hidden by one that does not. Heads beyond the eighth share the last slot.
    std::array<int, 8> num_rejected{};
    std::size_t head = 0;  ///< The head that observed last, its time, and the time of another head's last observation.
    double t_head_s = 0.0, t_other_s = 0.0;
  };

  [[nodiscard]] Entry& entry(std::size_t i) { return kept_[(first_ + i) % kept_.size()]; }
  [[nodiscard]] const Entry& entry(std::size_t i) const { return kept_[(first_ + i) % kept_.size()]; }
  [[nodiscard]] const Entry& newest() const { return entry(count_ - 1); }

  /// Drops entries before which nothing can be inserted any more. Returns their number.
  std::size_t make_room(std::size_t place) {
    std::size_t dropped = 0;
    const double oldest_s = newest_time() - config_.history_s;
    const std::size_t least = std::min(max_of_a_streak, kept_.size() - 1);
    while (count_ > 1 && dropped < place &&
           ((count_ > least && entry(1).observation.t_capture_s < oldest_s) || count_ == kept_.size())) {
      first_ = (first_ + 1) % kept_.size();
      --count_;
      ++dropped;
      has_forgotten_ = true;
    }
    if (count_ == kept_.size()) --count_;  // the observation is older than all entries: the newest makes room
    return dropped;
  }
  [[nodiscard]] double newest_time() const { return count_ > 0 ? newest().observation.t_capture_s : -1e300; }

  [[nodiscard]] bool is_in_image(const TargetObservation& observation) const {
    if (!(observation.head < heads_.size()) || !std::isfinite(observation.t_capture_s) ||
        !observation.pan_tilt_rad.allFinite())
      return false;
    const Camera& camera = heads_[observation.head].camera;
    return observation.px.x() >= -0.5 && observation.px.y() >= -0.5 && observation.px.x() <= camera.width_px - 0.5 &&
           observation.px.y() <= camera.height_px - 0.5;
  }
  [[nodiscard]] double sigma_encoder(std::size_t head) const {
    const double own = heads_[head].head.encoder.sigma_rad;
    return own > 0.0 ? own : config_.sigma_encoder_rad;
  }
  [[nodiscard]] bool is_in_range(double depth_m) const {
    return depth_m >= config_.min_depth_m && depth_m <= config_.max_depth_m;
  }

  TrackStep rejected(TrackEvent event) {
    TrackStep step;
    step.event = event;
    report_newest(step);
    return step;
  }
  void report_newest(TrackStep& step) const {
    if (count_ == 0) return;
    step.t_s = newest().observation.t_capture_s;
    step.has_belief = newest().has_started;
    if (!step.has_belief) return;
    step.belief = newest().filter.estimate();
    count_range_drift(newest(), step.t_s, step.belief);
  }

  /// With a single head, nothing corrects the range: a lasting acceleration moves
  /// the target along that head's rays more than the white one of the model does.
  void count_range_drift(const Entry& last, double t_s, Belief<6>& belief) const {
    if (config_.method != TargetMotion::cv && config_.method != TargetMotion::turn) return;
    if (!(last.t_head_s - last.t_other_s > one_head_after_s)) return;
    const double alone_s = t_s - last.t_other_s, alone_s2 = alone_s * alone_s;
    const double counted_before = std::pow(one_head_after_s, 4) / (alone_s2 * alone_s2);
    const auto ray = ray_in_world(heads_[last.observation.head], last.observation);
    if (!ray) return;
    Eigen::Vector<double, 6> drift;
    drift << 0.5 * alone_s2 * ray->direction_in_world, alone_s * ray->direction_in_world;
    drift *= config_.sigma_a_m_s2;
    belief.P += (1.0 - counted_before) * drift * drift.transpose();
  }

  /// Processes the observation at this index, given the entry before it.
  void apply(std::size_t place, TrackStep& step) {
    Entry& now = entry(place);
    now.began = now.accepted = false;
    if (place == 0) {
      now.has_started = false;
      now.num_rejected = {};
      step.event = TrackEvent::waiting;
      return;
    }
    const Entry& before = entry(place - 1);
    now.filter = before.filter;
    now.has_started = before.has_started;
    now.num_rejected = before.num_rejected;
    now.head = before.head;
    now.t_head_s = before.t_head_s;
    now.t_other_s = before.t_other_s;
    if (!now.has_started) {
      step.accepted = now.accepted = begin(place);
      step.event = step.accepted ? TrackEvent::start : TrackEvent::waiting;
      return;
    }
    now.filter.predict(models_, now.observation.t_capture_s - before.observation.t_capture_s);
    step.event = use(now, step);
    step.accepted = step.event == TrackEvent::none;
    int& num_rejected = now.num_rejected[std::min(now.observation.head, now.num_rejected.size() - 1)];
    if (step.accepted) {
      num_rejected = 0;
      note_head(now);
      if (now.t_head_s - now.t_other_s > one_head_after_s) step.event = TrackEvent::one_head;
    } else if (++num_rejected >= config_.restart_after && begin_again(place)) {
      step.event = TrackEvent::restart;
      step.accepted = true;
    }
    now.accepted = step.accepted;
  }

  /// Restarts the track if a new one explains the observations since the first rejection of a head: it
  /// must accept three more than the old one did, so that single false observations do not end a track.
  bool begin_again(std::size_t place) {
    constexpr int more = 3;
    const std::size_t head = entry(place).observation.head;
    std::size_t first = place;
    for (std::size_t i = place; i-- > 0 && place - i < max_of_a_streak;) {
      if (entry(i).observation.head != head) continue;
      if (entry(i).accepted) break;
      first = i;
    }
    for (std::size_t i = first; i < place; ++i) {
      if (entry(i).observation.head != head) continue;
      const auto other = other_before(i);
      if (!other) continue;
      int enough = more, new_takes = 2;
      for (std::size_t k = *other; k < place; ++k) enough += entry(k).accepted ? 1 : 0;
      const auto may_be_enough = [&](std::size_t last) { return new_takes + static_cast<int>(place - last) >= enough; };
      if (!may_be_enough(i)) continue;
      const auto filter = begun(entry(*other).observation, entry(i).observation);
      if (!filter) continue;
      Entry trial;
      trial.filter = *filter;
      for (std::size_t k = i + 1; k <= place && may_be_enough(k - 1); ++k) {
        trial.filter.predict(models_, entry(k).observation.t_capture_s - entry(k - 1).observation.t_capture_s);
        trial.observation = entry(k).observation;
        TrackStep ignored;
        new_takes += use(trial, ignored) == TrackEvent::none ? 1 : 0;
      }
      if (new_takes < enough) continue;
      set_begun(place, *other, trial.filter);
      return true;
    }
    return false;
  }

  /// The last observation of another head at about the same time as this one.
  [[nodiscard]] std::optional<std::size_t> other_before(std::size_t place) const {
    const TargetObservation& now = entry(place).observation;
    for (std::size_t i = place; i-- > 0 && now.t_capture_s - entry(i).observation.t_capture_s <= config_.together_s;)
      if (entry(i).observation.head != now.head) return i;
    return std::nullopt;
  }

  void set_begun(std::size_t place, std::size_t other, const Filter& filter) {
    Entry& now = entry(place);
    now.filter = filter;
    now.has_started = now.began = true;
    now.num_rejected = {};
    now.head = now.observation.head;
    now.t_head_s = now.observation.t_capture_s;
    now.t_other_s = entry(other).observation.t_capture_s;
  }

  void note_head(Entry& now) const {
    if (now.observation.head != now.head) {
      now.t_other_s = now.t_head_s;
      now.head = now.observation.head;
    }
    now.t_head_s = now.observation.t_capture_s;
  }

  /// Updates with the observation if it passes the gates, and then returns `none`.
  TrackEvent use(Entry& now, TrackStep& step) const {
    const ObservationModel see(heads_[now.observation.head], now.observation.pan_tilt_rad,
                               sigma_px_of(now.observation, config_.sigma_px), sigma_encoder(now.observation.head),
                               now.observation.lens);
    const Eigen::Vector3d position = now.filter.position();
    if (!is_in_range(see.depth_m(position))) return TrackEvent::depth;
    const auto expected = see(position);
    if (!expected) return TrackEvent::depth;
    const Filter prior = now.filter;
    if constexpr (Filter::considers) {
      const auto effect = rig_error_effect(config_.errors.factor[now.observation.head], see.turned, *see.camera,
                                           position, now.filter.velocity(), now.observation.lens);
      if (!effect) return TrackEvent::depth;
      step.innovation = now.filter.expect(*expected, *effect, now.observation.px);
      step.has_innovation = true;
      if (!(step.innovation.nis < config_.gate)) return TrackEvent::gated;
      if (!now.filter.update(*expected, *effect, now.observation.px, see, config_.update)) return TrackEvent::gated;
    } else {
      step.innovation = now.filter.expect(*expected, now.observation.px);
      step.has_innovation = true;
      if (!(step.innovation.nis < config_.gate)) return TrackEvent::gated;
      if (!now.filter.update(*expected, now.observation.px, see, config_.update)) return TrackEvent::gated;
    }
    if (!is_in_range(see.depth_m(now.filter.position()))) {
      now.filter = prior;
      return TrackEvent::depth;
    }
    return TrackEvent::none;
  }

  /// Starts the track at this index from its observation and the last one of another
  /// head, if they are nearly simultaneous and their rays meet in the working range.
  bool begin(std::size_t place) {
    const auto other = other_before(place);
    if (!other) return false;
    const auto filter = begun(entry(*other).observation, entry(place).observation);
    if (!filter) return false;
    set_begun(place, *other, *filter);
    return true;
  }

  [[nodiscard]] std::optional<Filter> begun(const TargetObservation& earlier, const TargetObservation& later) const {
    const auto ray_a = ray_in_world(heads_[earlier.head], earlier);
    const auto ray_b = ray_in_world(heads_[later.head], later);
    if (!ray_a || !ray_b) return std::nullopt;
    const auto met = nearest_to_rays(*ray_a, *ray_b);
    if (!met) return std::nullopt;
    const double distance_m = (*met - ray_a->origin_in_world).norm();
    const double sigma_m = std::max(config_.start_sigma_m, 0.1 * distance_m);
    Belief<6> first;
    first.x << *met, Eigen::Vector3d::Zero();
    first.P.topLeftCorner<3, 3>() *= sigma_m * sigma_m;
    first.P.bottomRightCorner<3, 3>() *= config_.start_sigma_v_m_s * config_.start_sigma_v_m_s;
    Entry trial;
    trial.filter.start(models_, first);
    TrackStep ignored;
    trial.observation = earlier;
    if (use(trial, ignored) != TrackEvent::none) return std::nullopt;
    trial.filter.predict(models_, later.t_capture_s - earlier.t_capture_s);
    trial.observation = later;
    if (use(trial, ignored) != TrackEvent::none) return std::nullopt;
    return trial.filter;
  }

  static constexpr double one_head_after_s = 0.5;
  static constexpr std::size_t max_of_a_streak = 16;  ///< Observations from which a new track may start.

  std::vector<RigHead> heads_;
  TrackerConfig config_;
  Models models_;
  std::vector<Entry> kept_;  ///< A ring buffer: `count_` entries from `first_` on, in order of capture.
  std::size_t first_ = 0, count_ = 0;
  bool has_forgotten_ = false;
};

}  // namespace alidade::detail
