#include "alidade/heads/head_follow.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <opencv2/core.hpp>
#include <optional>

#include "alidade/files/files.h"
#include "alidade/geometry/degree.h"
#include "alidade/servo/bearing_filter.h"

namespace alidade {
namespace {

constexpr double command_every_s = 0.125, ask_every_s = 0.05;
constexpr double far_m = 1e6;  // bearings alone count

/// Pan and tilt at a time, between two readings.
std::optional<Eigen::Vector2d> angles_at(const std::vector<HeadPosition>& readings, double t_s) {
  const auto after = std::ranges::lower_bound(readings, t_s, {}, &HeadPosition::t_s);
  if (after == readings.begin() || after == readings.end()) return std::nullopt;
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
        result_(result) {
    head_.on_reading = [this](const HeadPosition& reading) { readings_.push_back(reading); };
  }
  ~Follower() { head_.on_reading = nullptr; }
  Follower(const Follower&) = delete;
  Follower& operator=(const Follower&) = delete;

  void run() {
    begin_s_ = last_frame_s_ = head_.now_s();
    double next_command_s = begin_s_ + 0.5, next_question_s = begin_s_;
    while (head_.now_s() - begin_s_ < config_.most_s) {
      report_progress(progress_, "following: s of head time", static_cast<std::size_t>(head_.now_s() - begin_s_), 0);
      head_.wait_until(next_question_s);
      (void)head_.position();
      next_question_s = head_.now_s() + ask_every_s;
      look();
      if (head_.now_s() < next_command_s) continue;
      next_command_s = head_.now_s() + command_every_s;
      aim_head();
    }
    head_.stop();
    result_.head_time_s = head_.now_s() - begin_s_;
  }

 private:
  /// Frames that came, once the head's angles at their times are known.
  void look() {
    constexpr double lost_s = 2.0, old_s = 0.5;
    for (StreamFrame& frame : stream_.take()) {
      last_frame_s_ = head_.now_s();
      waiting_.push_back(std::move(frame));
    }
    while (!waiting_.empty()) {
      const StreamFrame& frame = waiting_.front();
      const double shown_s = frame.t_s + config_.delay_s;
      const std::optional<Eigen::Vector2d> angles = angles_at(readings_, shown_s);
      if (!angles && shown_s > readings_.back().t_s - old_s) break;
      if (angles && waiting_.size() < 4)
        see(frame, shown_s, *angles);  // those that cannot be looked at in time are left
      waiting_.pop_front();
    }
    if (head_.now_s() - last_frame_s_ < lost_s) return;
    head_.stop();
    throw InputError(fmt::format("{}: no frame for {:g} s; the stream is lost", stream_.name(), lost_s));
  }

  void see(const StreamFrame& frame, double t_s, const Eigen::Vector2d& angles) {
    const TargetDetection seen = detector_.find(*frame.image);
    FollowedFrame row{
        .t_s = t_s - begin_s_, .pan_tilt_rad = angles, .is_found = seen.found(), .px = seen.px, .target_rad = angles};
    if (const auto ray = seen.found() ? ray_in_world(rig_head_, angles, seen.px) : std::nullopt) {
      const std::optional<Eigen::Vector2d> target =
          aim(rig_head_.head, ray->origin_in_world + far_m * ray->direction_in_world);
      row.is_found = target.has_value();
      if (target) learn(t_s, nearest_turn(*target, angles), row);
    }
    row.error_px = (row.px - project_axis(rig_head_.camera)).norm();
    result_.frames.push_back(row);
  }
  [[nodiscard]] static Eigen::Vector2d nearest_turn(Eigen::Vector2d target, const Eigen::Vector2d& here) {
    constexpr double turn = 6.283185307179586;
    target[0] += turn * std::round((here[0] - target[0]) / turn);
    return target;
  }
  void learn(double t_s, const Eigen::Vector2d& target, FollowedFrame& row) {
    constexpr double sigma_rad = 0.03 * degree, forgotten_s = 1.0;
    row.target_rad = target;
    for (std::size_t i = 0; i < 2; ++i) {
      const double angle = target[static_cast<Eigen::Index>(i)];
      if (!seen_s_ || t_s - *seen_s_ > forgotten_s) {
        axes_[i].start(t_s, angle, sigma_rad * sigma_rad);
      } else if (t_s > *seen_s_) {
        axes_[i].update(t_s, angle, sigma_rad * sigma_rad);
      }
    }
    seen_s_ = std::max(seen_s_.value_or(t_s), t_s);
  }

  /// Where the target will be in the middle of the time for which the command counts.
  void aim_head() {
    constexpr double lost_s = 1.0;
    const double now_s = head_.now_s();
    if (!seen_s_ || now_s - *seen_s_ > lost_s) {
      if (is_following_) head_.stop();
      is_following_ = false;
      return;
    }
    const double acts_s = now_s + config_.latency_s + command_every_s;
    Eigen::Vector2d target(axes_[0].at(acts_s).angle_rad, axes_[1].at(acts_s).angle_rad);
    target = target.cwiseMax(head_.low_rad()).cwiseMin(head_.high_rad());
    head_.command(target);
    ++result_.num_commands;
    is_following_ = true;
  }
  static Eigen::Vector2d project_axis(const Camera& camera) {
    RigHead plain;
    plain.camera = camera;
    const auto pixel = project(plain, Eigen::Vector2d::Zero(), Eigen::Vector3d(0.0, 0.0, far_m));
    return pixel ? pixel->px : Eigen::Vector2d::Zero();
  }

  MovingHead& head_;
  FrameStream& stream_;
  const RigHead& rig_head_;
  TargetDetector detector_;
  const HeadFollowConfig& config_;
  const Progress& progress_;
  HeadFollowing& result_;
  std::vector<HeadPosition> readings_;
  std::deque<StreamFrame> waiting_;
  std::array<BearingAxis, 2> axes_{BearingAxis(BearingFilterConfig{}), BearingAxis(BearingFilterConfig{})};
  std::optional<double> seen_s_;
  double begin_s_ = 0.0, last_frame_s_ = 0.0;
  bool is_following_ = false;
};

void judge(HeadFollowing& result, double shorter_side_px) {
  constexpr double settled_share = 1.0 / 3.0, most_lost = 0.2;
  std::size_t found = 0, counted = 0, central = 0;
  double sum2 = 0.0;
  for (const FollowedFrame& frame : result.frames) {
    if (frame.t_s < settled_share * result.head_time_s) continue;
    ++counted;
    if (!frame.is_found) continue;
    ++found;
    sum2 += frame.error_px * frame.error_px;
    result.max_px = std::max(result.max_px, frame.error_px);
    central += frame.error_px < shorter_side_px / 6.0;
  }
  if (found == 0) {
    result.verdict.state = State::refused;
    result.verdict.exit_code = ExitCode::cannot_tell;
    result.verdict.sentence = "the target was not found in the image";
    result.verdict.to_add = "point the head at the target first, and say with --follow what it looks like";
    return;
  }
  result.rms_px = std::sqrt(sum2 / static_cast<double>(found));
  result.central_third = static_cast<double>(central) / static_cast<double>(counted);
  const double lost = 1.0 - static_cast<double>(found) / static_cast<double>(counted);
  result.verdict.sentence = fmt::format("the target stands {:.3g} px RMS from the principal point, {:.3g} px at most",
                                        result.rms_px, result.max_px);
  result.verdict.checks.push_back({"found", lost > most_lost ? State::care : State::good,
                                   fmt::format("found in {:.0f} % of the frames", 100.0 * (1.0 - lost)), lost,
                                   most_lost, "", ""});
  if (lost > most_lost) result.verdict.state = State::care;
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
    Follower(head, stream, rig_head, TargetDetector(look, pattern), config, progress, result).run();
  }
  judge(result, std::min(rig_head.camera.width_px, rig_head.camera.height_px));
  return result;
}

}  // namespace alidade
