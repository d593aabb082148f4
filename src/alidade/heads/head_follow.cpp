#include "alidade/heads/head_follow.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <numbers>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>

#include "alidade/files/files.h"
#include "alidade/geometry/degree.h"
#include "alidade/heads/axis_course.h"
#include "alidade/heads/follow_forecast.h"
#include "alidade/servo/head_servo.h"

namespace alidade {
namespace {

/// Between two points of a course; none: outside of it.
std::optional<Eigen::Vector2d> between(const std::vector<HeadPosition>& course, double t_s) {
  const auto after = std::ranges::lower_bound(course, t_s, {}, &HeadPosition::t_s);
  if (after == course.begin() || after == course.end()) return std::nullopt;
  const HeadPosition &a = *(after - 1), &b = *after;
  const double share = (t_s - a.t_s) / std::max(1e-6, b.t_s - a.t_s);
  return a.pan_tilt_rad + share * (b.pan_tilt_rad - a.pan_tilt_rad);
}

class Follower {
 public:
  Follower(MovingHead& head, FrameStream& stream, const RigHead& rig_head, TargetDetector detector,
           const HeadFollowConfig& config, const Progress& progress, HeadFollowing& result)
      : head_(head),
        stream_(stream),
        rig_head_(rig_head),
        detector_(std::move(detector)),
        config_(config),
        progress_(progress),
        result_(result),
        filter_({.gate = follow_gate}) {
    const HeadPosition here = first_position();
    for (std::size_t i = 0; i < 2; ++i)
      axes_.emplace_back(config.axes[i], here.pan_tilt_rad[static_cast<Eigen::Index>(i)], here.t_s);
    head_.on_reading = [this](const HeadPosition& reading) {
      for (std::size_t i = 0; i < 2; ++i)
        axes_[i].read(reading.t_s, reading.pan_tilt_rad[static_cast<Eigen::Index>(i)]);
      read_s_ = reading.t_s;
    };
  }
  ~Follower() { head_.on_reading = nullptr; }
  Follower(const Follower&) = delete;
  Follower& operator=(const Follower&) = delete;

  void run() {
    begin_s_ = last_frame_s_ = head_.now_s();
    try {
      follow();
      head_.stop();
    } catch (const Interrupted&) {  // the head first, then what was seen before is kept
      stop_anyhow();
      if (result_.frames.empty()) throw;
      result_.is_interrupted = true;
    } catch (const InputError& fault) {
      stop_anyhow();
      if (result_.frames.empty()) throw;
      result_.fault = fault.what();
    }
    result_.head_time_s = head_.now_s() - begin_s_;
    result_.image_age_s = num_ages_ > 0 ? sum_age_s_ / static_cast<double>(num_ages_) : 0.0;
  }

 private:
  void follow() {
    const double period_s = result_.period_s;
    double next_s = begin_s_ + period_s;
    while (head_.now_s() - begin_s_ < config_.max_s) {
      report_progress(progress_, "following: s of head time", static_cast<std::size_t>(head_.now_s() - begin_s_), 0);
      ask(next_s);
      aim_head();
      tell_so_far();
      next_s = std::max(next_s, head_.now_s() - period_s) + period_s;
    }
  }
  void stop_anyhow() {
    try {
      head_.stop();
    } catch (const InputError&) {  // it is the head that is lost
    }
  }
  /// Whoever kills this process finds what was seen until a few seconds ago.
  void tell_so_far() {
    constexpr double pause_s = 3.0, pause_share = 0.05;  // all that was seen is reported each time
    const double time_s = head_.now_s() - begin_s_;
    if (!config_.on_so_far || result_.frames.empty() || time_s - given_s_ < std::max(pause_s, pause_share * time_s))
      return;
    given_s_ = time_s;
    config_.on_so_far(result_);
  }
  /// Where it is; commands follow one another as fast as its answers and its pace allow.
  HeadPosition first_position() {
    constexpr double calls = 3.0, slowest_s = 1.0;  // a question, and a command that asks before
    constexpr double question_s = 0.025;            // the pace of a head that may move
    std::array<double, 5> waits{};
    HeadPosition here;
    for (double& wait_s : waits) wait_s = (here = head_.position()).wait_s;
    std::ranges::nth_element(waits, waits.begin() + 2);
    result_.period_s = std::clamp(1.2 * calls * waits[2], calls * question_s, slowest_s);
    return here;
  }

  /// At that time: frames that came before a question have angles before and after.
  void ask(double at_s) {
    head_.wait_until(at_s);
    collect();
    (void)head_.position();
    look();
  }
  [[nodiscard]] std::optional<Eigen::Vector2d> angles_at(double t_s) const {
    const std::optional<double> pan = axes_[0].at(t_s), tilt = axes_[1].at(t_s);
    if (!pan || !tilt) return std::nullopt;
    return Eigen::Vector2d(*pan, *tilt);
  }
  void collect() {
    for (StreamFrame& frame : stream_.take()) {
      last_frame_s_ = head_.now_s();
      waiting_.push_back(std::move(frame));
    }
  }

  /// How many frames can be looked at before the next command: the newest.
  [[nodiscard]] std::size_t in_time() const {
    constexpr double share = 0.5, most = 3.0;
    return static_cast<std::size_t>(std::clamp(share * result_.period_s / std::max(look_s_, 1e-6), 1.0, most));
  }
  /// Frames that came, once the head's angles at their times are known.
  void look() {
    constexpr double old_s = 0.5;
    std::deque<std::pair<StreamFrame, Eigen::Vector2d>> known;
    const double lost_s = 2.0 + 2.0 * stream_.exposure_s();
    while (!waiting_.empty()) {
      const double shown_s = waiting_.front().t_s + config_.delay_s;
      const std::optional<Eigen::Vector2d> angles = angles_at(shown_s);
      if (!angles && shown_s > read_s_ - old_s) break;
      if (angles) known.emplace_back(std::move(waiting_.front()), *angles);
      result_.num_skipped += angles ? 0 : 1;
      waiting_.pop_front();
    }
    const std::size_t late = known.size() - std::min(known.size(), in_time());
    result_.num_skipped += late;
    known.erase(known.begin(), known.begin() + static_cast<std::ptrdiff_t>(late));
    for (const auto& [frame, angles] : known) {
      const double begin_s = head_.now_s();
      see(frame, frame.t_s + config_.delay_s, angles);
      constexpr double newest = 0.3;
      look_s_ += newest * (head_.now_s() - begin_s - look_s_);
    }
    if (head_.now_s() - last_frame_s_ < lost_s) return;
    head_.stop();
    throw InputError(fmt::format("{}: no frame for {:g} s; the stream is lost", stream_.name(), lost_s));
  }

  void see(const StreamFrame& frame, double t_s, const Eigen::Vector2d& angles) {
    const TargetDetection seen = detector_.find(*frame.image);
    FollowedFrame row{.t_s = t_s - begin_s_,
                      .pan_tilt_rad = angles,
                      .is_found = seen.found(),
                      .px = seen.px,
                      .target_rad = angles,
                      .error_px = seen.px - centre_of(rig_head_.camera),
                      .asked_rad = between(asked_, t_s)};
    const auto ray = seen.found() ? ray_in_world(rig_head_, angles, seen.px) : std::nullopt;
    const auto target =
        ray ? aim(rig_head_.head, ray->origin_in_world + follow_range_m * ray->direction_in_world) : std::nullopt;
    row.is_found = target.has_value();
    if (target) take(t_s, row.target_rad = nearest_turn(*target, angles));
    result_.frames.push_back(row);
    if (config_.on_frame) config_.on_frame(row, *frame.image);
  }

  [[nodiscard]] static Eigen::Vector2d nearest_turn(Eigen::Vector2d target, const Eigen::Vector2d& here) {
    target[0] = here[0] + std::remainder(target[0] - here[0], 2.0 * std::numbers::pi);
    return target;
  }
  void take(double t_s, const Eigen::Vector2d& bearing_rad) {
    constexpr double forgotten_s = 1.0;
    if (filter_.has_started() && t_s - filter_.newest_s() > forgotten_s) filter_.forget();
    constexpr double sigma_px = 0.3;  // of the target's centre
    (void)filter_.take(t_s, bearing_rad, std::hypot(sigma_px / focal_of(rig_head_.camera), config_.resolution_rad));
  }

  /// Where the target will be once the command has acted for a period: what comes after it has then begun.
  void aim_head() {
    constexpr double lost_s = 1.0;
    const double now_s = head_.now_s();
    if (!filter_.has_started() || now_s - filter_.newest_s() > lost_s) {
      if (is_following_) head_.stop();
      is_following_ = false;
      return;
    }
    sum_age_s_ += now_s - filter_.newest_s();
    ++num_ages_;
    const Eigen::Vector2d command = planned(now_s).cwiseMax(head_.low_rad()).cwiseMin(head_.high_rad());
    const HeadSent sent = head_.command_at_once(command);
    for (std::size_t i = 0; i < 2; ++i) axes_[i].send(sent.t_s, command[static_cast<Eigen::Index>(i)]);
    ++result_.num_commands;
    is_following_ = true;
  }
  [[nodiscard]] Eigen::Vector2d planned(double now_s) {
    Eigen::Vector2d command, asked;
    for (std::size_t i = 0; i < 2; ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      const double acts_s = now_s + config_.axes[i].latency_s;
      const Bearing then = filter_.at(acts_s)[i];
      asked[k] = then.angle_rad;
      command[k] = filter_.at(acts_s + result_.period_s)[i].angle_rad;
    }
    asked_.push_back({now_s + config_.axes[0].latency_s, 0.0, asked});
    return command;
  }

  MovingHead& head_;
  FrameStream& stream_;
  const RigHead& rig_head_;
  TargetDetector detector_;
  const HeadFollowConfig& config_;
  const Progress& progress_;
  HeadFollowing& result_;
  BearingFilter filter_;
  std::vector<AxisCourse> axes_;
  std::vector<HeadPosition> asked_;
  double read_s_ = 0.0;
  std::deque<StreamFrame> waiting_;
  double begin_s_ = 0.0, last_frame_s_ = 0.0, sum_age_s_ = 0.0, given_s_ = 0.0;
  double look_s_ = 0.0;  ///< What a frame takes.
  std::size_t num_ages_ = 0;
  bool is_following_ = false;
};

void judge(HeadFollowing& result, double shorter_side_px) {
  constexpr double settled_share = 1.0 / 3.0, max_lost = 0.2;
  std::size_t found = 0, counted = 0, central = 0;
  double sum2 = 0.0;
  for (const FollowedFrame& frame : result.frames) {
    if (frame.t_s < settled_share * result.head_time_s) continue;
    ++counted;
    if (!frame.is_found) continue;
    ++found;
    const double error_px = frame.error_px.norm();
    sum2 += error_px * error_px;
    result.max_px = std::max(result.max_px, error_px);
    central += error_px < shorter_side_px / 6.0;
  }
  if (found == 0) {
    result.verdict.state = State::refused;
    result.verdict.exit_code = ExitCode::undetermined;
    result.verdict.sentence = "the target was not found in the image";
    result.verdict.to_add = "point the head at the target first, and say with --follow what it looks like";
    return;
  }
  result.rms_px = std::sqrt(sum2 / static_cast<double>(found));
  result.central_third = static_cast<double>(central) / static_cast<double>(counted);
  const double lost = 1.0 - static_cast<double>(found) / static_cast<double>(counted);
  result.verdict.sentence = fmt::format("the target is {:.3g} px RMS from the principal point, {:.3g} px at most",
                                        result.rms_px, result.max_px);
  result.verdict.checks.push_back({"found", lost > max_lost ? State::care : State::good,
                                   fmt::format("found in {:.0f} % of the frames", 100.0 * (1.0 - lost)), lost, max_lost,
                                   "", ""});
  if (lost > max_lost) result.verdict.state = State::care;
}

/// What broke it off is said before what was seen until then.
void heed_break(HeadFollowing& result) {
  if (result.is_interrupted) {
    result.verdict.sentence =
        fmt::format("interrupted after {:.1f} s; {}", result.head_time_s, result.verdict.sentence);
    result.verdict.checks.push_back({.name = "interrupted",
                                     .state = State::care,
                                     .text = "ended by hand: the exit code of the command is that of the interrupt"});
    if (result.verdict.state == State::good) result.verdict.state = State::care;
  }
  if (result.fault.empty()) return;
  result.verdict.state = State::refused;
  result.verdict.exit_code = ExitCode::undetermined;
  result.verdict.sentence = result.fault + "; " + result.verdict.sentence;
  result.verdict.to_add = "mend the link and run it again";
}

/// Whether the loop does what a loop with this head can.
void compare_with_forecast(HeadFollowing& result) {
  constexpr double most = 1.3, own_px = 1.0;  // of what is seen of a target at rest
  if (!result.forecast || result.verdict.state == State::refused) return;
  const double own2 = own_px * own_px, moved_px = std::sqrt(std::max(0.0, result.rms_px * result.rms_px - own2));
  const double ratio = moved_px / std::max(1e-9, result.forecast->rms_px);
  const bool is_good = ratio <= most;
  result.verdict.checks.push_back(
      {"as predicted", is_good ? State::good : State::care,
       fmt::format("{:.3g} px RMS; servo predicts {:.3g} px for this head, these delays and this target", result.rms_px,
                   result.forecast->rms_px),
       ratio, most, "", ""});
  if (is_good) return;
  result.verdict.state = State::care;
  result.verdict.to_add = "give --identified, the folder of --identify, and --delay as --calibrate has it";
}

}  // namespace

HeadFollowing follow_target(HeadDevice& device, FrameStream& stream, const RigHead& rig_head, const TargetLook& look,
                            const cv::Mat* pattern, const HeadFollowConfig& config, const Progress& progress) {
  HeadFollowing result;
  result.url = device.name();
  result.stream = stream.name();
  {
    MovingHead head(device, config.range.low_rad, config.range.high_rad, progress);
    if ((head.high_rad() - head.low_rad()).maxCoeff() > 1e4)
      throw InputError(device.name() + ": names no limits; give --pan-range and --tilt-range");
    const HeadRange within{head.low_rad(), head.high_rad()};
    Follower(head, stream, rig_head, TargetDetector(look, pattern), config, progress, result).run();
    result.forecast = forecast_of(result, rig_head, config, within);
  }
  judge(result, std::min(rig_head.camera.width_px, rig_head.camera.height_px));
  compare_with_forecast(result);
  heed_break(result);
  return result;
}

}  // namespace alidade
