#include "alidade/heads/head_calibrate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "alidade/estimation/config_error.h"
#include "alidade/estimation/median.h"
#include "alidade/files/files.h"
#include "alidade/geometry/degree.h"
#include "alidade/heads/calibration/board_reach.h"
#include "alidade/heads/calibration/calibration_log.h"
#include "alidade/heads/calibration/calibration_verdict.h"
#include "alidade/heads/calibration/head_shots.h"
#include "alidade/heads/streams/frame_follower.h"
#include "alidade/heads/turn_log.h"
#include "alidade/observe.h"
#include "alidade/tables/rotation_log_file.h"

namespace alidade {
namespace {

/// The head and the stream together, for one calibration.
class Session {
 public:
  Session(MovingHead& head, FrameStream& stream, const HeadCalibrationConfig& config, const Progress& progress,
          HeadCalibration& result)
      : head_(head),
        stream_(stream),
        config_(config),
        progress_(progress),
        result_(result),
        follower_(config.board, head.device().clock().is_free()) {
    head_.on_reading = [this](const HeadPosition& reading) { readings_.push_back(reading); };
  }
  ~Session() { head_.on_reading = nullptr; }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  void run() {
    begin_s_ = last_frame_s_ = head_.now_s();
    try {
      watch(0.6);
      heed_slow_answers();
      moves();
      head_.stop();
    } catch (const InputError& fault) {  // a link is lost: the head first, then what was measured before is kept
      stop_anyhow();
      if (result_.num_frames == 0 || result_.num_moves < 3) throw;
      result_.fault = fault.what();
    }
    result_.head_time_s = head_time();
    result_.sigma_clock_s = clock_sigma();
    estimate();
    result_.num_skipped = follower_.num_skipped();
    result_.times = follower_.times();
    result_.sigma_frame_s = follower_.sigma_s();
    result_.num_jumps = follower_.stamps().is_jumping() ? follower_.stamps().num_jumps() : 0;
    result_.largest_jump_s = follower_.stamps().largest_s();
  }

 private:
  void moves() {
    if (config_.board) {
      find_board_room();
      move_to(within(at() + 2.0 * degree * Eigen::Vector2d(towards_middle(0), towards_middle(1))));
      for (int i = 0; i < 5; ++i) board_move();
    } else {
      first_moves();
    }
    bool goes_on = true;
    while (goes_on && left_s() > 0.0) {
      if (determines_both_axes() && left_s() > 1.5 * estimate_s_) estimate();
      if (is_reached() && head_time() > min_s()) break;
      goes_on = config_.board ? board_move() : next_moves();
    }
  }

  /// Said before it moves: each rest lasts for a few answers.
  void heed_slow_answers() {
    constexpr double fewest_moves = 8.0, way_s = 0.5;
    const double move_s = way_s + rest_s() + answer_s(), moves = (config_.max_s - 4.0) / move_s;
    if (moves >= fewest_moves || rest_s() < 2.0 * least_rest_s) return;
    throw InputError(
        fmt::format("{}: answers take {:.2g} s, so that a move and its rest take {:.2g} s: {:.0f} s are too "
                    "few; nothing was moved; give --most {:.0f}",
                    head_.device().name(), answer_s(), move_s, config_.max_s, std::ceil(fewest_moves * move_s + 5.0)));
  }
  void find_board_room() {
    const std::vector<SeenFrame> seen = follower_.seen();
    if (seen.empty() || seen.back().points.empty())
      throw InputError(fmt::format("{}: not all of a board of {}×{} corners is in view; point the head at it first",
                                   stream_.name(), config_.board->cols, config_.board->rows));
    reach_.emplace(seen.back().points, at(), result_.width_px, result_.height_px);
  }
  /// To where the board is seen elsewhere in the image; where it was lost, back to where it was seen.
  bool board_move() {
    move_to(within(reach_->next(focal_px_ > 0.0 ? focal_px_ : 1.1 * result_.width_px)));
    const std::vector<SeenFrame> seen = follower_.seen_so_far();
    if (!seen.empty() && seen.back().points.empty()) {
      reach_->shrink();
      move_to(within(reach_->home_rad()));
    }
    return left_s() > 0.0;
  }
  [[nodiscard]] double towards_middle(int axis) const {
    return at()[axis] < 0.5 * (head_.low_rad()[axis] + head_.high_rad()[axis]) ? 0.7 : -0.7;
  }
  [[nodiscard]] Eigen::Vector2d within(const Eigen::Vector2d& target) const {
    return target.cwiseMax(head_.low_rad()).cwiseMin(head_.high_rad());
  }
  /// Who asked and who answered do not agree better on when than the answer took.
  [[nodiscard]] double clock_sigma() const {
    constexpr double machine_s = 1e-4;
    return std::hypot(machine_s, answer_s() / std::sqrt(12.0));
  }
  [[nodiscard]] double answer_s() const {
    std::vector<double> waits;
    for (const HeadPosition& each : readings_) waits.push_back(each.wait_s);
    return waits.empty() ? 0.0 : median_of(std::move(waits));
  }
  /// Long enough for frames between two answers that are known to be of it.
  [[nodiscard]] double rest_s() const { return least_rest_s + 2.0 * answer_s(); }
  void stop_anyhow() {
    try {
      head_.stop();
    } catch (const InputError&) {  // it is the head that is lost
    }
  }
  [[nodiscard]] double head_time() { return head_.now_s() - begin_s_; }
  /// Without a goal the usual time is used; with one it may be earlier.
  [[nodiscard]] double min_s() const { return config_.until ? 38.0 : std::min(62.0, 0.75 * config_.max_s); }
  [[nodiscard]] double left_s() { return config_.max_s - head_time() - 4.0; }

  void take_frames() {
    constexpr double lost_s = 10.0;  // it may come back; until then the head stands
    for (StreamFrame& frame : stream_.take()) {
      last_frame_s_ = head_.now_s();
      ++result_.num_frames;
      result_.width_px = frame.image->cols;
      result_.height_px = frame.image->rows;
      follower_.push(std::move(frame));
    }
    if (head_.now_s() - last_frame_s_ < silent_s) return;
    head_.stop();
    if (head_.now_s() - last_frame_s_ < lost_s) return;
    throw InputError(fmt::format("{}: no frame for {:g} s; the stream is lost", stream_.name(), lost_s));
  }
  /// Asks the head and takes frames for so long.
  void watch(double seconds) {
    constexpr double question_s = 0.035;  // five readings around a frame that comes with one of them, none being early
    for (const double until = head_.now_s() + seconds; head_.now_s() < until;) {
      report_progress(progress_, "calibrating: s of head time", static_cast<std::size_t>(head_time()), 0);
      head_.wait_until(next_s_);
      (void)head_.position();
      next_s_ = head_.now_s() + question_s;
      take_frames();
    }
  }
  [[nodiscard]] Eigen::Vector2d at() const { return readings_.back().pan_tilt_rad; }

  /// There, no faster than points can be followed, and a short rest.
  void move_to(const Eigen::Vector2d& target) {
    constexpr double max_s = 20.0;
    if (left_s() < 0.0) return;
    while (head_.now_s() - last_frame_s_ > silent_s) watch(0.1);
    ++result_.num_moves;
    const Eigen::Vector2d from = at(), way = target - from;
    const double pieces = std::max(1.0, std::ceil(way.norm() / longest_piece()));
    for (double piece = 1.0; piece <= pieces; piece += 1.0) {
      head_.command((from + way * piece / pieces).cwiseMax(head_.low_rad()).cwiseMin(head_.high_rad()));
      if (piece < pieces) watch(piece_s);
    }
    const double begin = head_.now_s();
    double still_since = begin;
    Eigen::Vector2d before = at();
    while (head_.now_s() - begin < max_s && head_.now_s() - std::max(still_since, begin + 0.3) < rest_s()) {
      watch(0.08);
      note_rate();
      if (at() != before) still_since = head_.now_s();
      before = at();
    }
    tell_so_far();
  }
  void note_rate() {
    constexpr std::size_t back = 5;
    if (readings_.size() <= back) return;
    const HeadPosition &a = readings_[readings_.size() - 1 - back], &b = readings_.back();
    if (b.t_s - a.t_s > 0.05) rate_ = std::max(rate_, (b.pan_tilt_rad - a.pan_tilt_rad).norm() / (b.t_s - a.t_s));
  }
  /// A head that is quicker than points can be followed is sent ahead of itself piece by piece.
  [[nodiscard]] double longest_piece() {
    const double max_px_per_frame = 0.035 * result_.width_px;
    const double span_s = last_frame_s_ - begin_s_;
    const auto followed = static_cast<double>(result_.num_frames - follower_.num_skipped());
    const double fps = span_s > 0.3 ? std::clamp(followed / span_s, 1.0, 60.0) : 10.0;
    const double f_px = focal_px_ > 0.0 ? focal_px_ : 1.1 * result_.width_px;
    const double max_rate = max_px_per_frame * fps / f_px;
    return rate_ > max_rate ? max_rate * piece_s : 1e9;
  }

  /// A box around the centre of what is near and allowed: first a small step, to learn how fast it is.
  void first_moves() {
    constexpr double reach = 12.0 * degree;
    const Eigen::Vector2d start = at().cwiseMax(head_.low_rad()).cwiseMin(head_.high_rad());
    Eigen::Vector2d low, high;
    for (int i = 0; i < 2; ++i) {
      const double wide = std::min(2.0 * reach, head_.high_rad()[i] - head_.low_rad()[i]);
      low[i] = std::clamp(start[i] - 0.5 * wide, head_.low_rad()[i], head_.high_rad()[i] - wide);
      high[i] = low[i] + wide;
    }
    const Eigen::Vector2d centre = 0.5 * (low + high), toward = (centre - start).norm() > degree
                                                                    ? (centre - start).normalized().eval()
                                                                    : Eigen::Vector2d(0.7, 0.7);
    move_to((start + toward * 2.0 * degree).cwiseMax(low).cwiseMin(high));
    for (const Eigen::Vector2d& corner :
         {Eigen::Vector2d(high[0], centre[1]), Eigen::Vector2d(centre[0], high[1]), Eigen::Vector2d(low[0], centre[1]),
          Eigen::Vector2d(centre[0], low[1]), centre})
      move_to(corner);
  }

  void estimate() {
    const double begin_s = head_.now_s();
    const std::vector<SeenFrame> seen = follower_.seen();
    result_.answer_s = answer_s();
    result_.has_seen_points = std::ranges::any_of(seen, [](const SeenFrame& each) { return !each.points.empty(); });
    result_.log_csv = log_of(seen);
    result_.report = observed(result_);
    for (const ObservedQuantity& each : result_.report.quantities) {
      if (each.name == "delay_s") late_s_ = std::clamp(-each.value, -1.0, 1.0);
      if (each.name == "fx") focal_px_ = each.value;
    }
    estimate_s_ = head_.now_s() - begin_s;
    tell_so_far();
  }
  [[nodiscard]] std::string log_of(const std::vector<SeenFrame>& seen) const {
    const RotationLog now = turn_log(readings_, seen, late_s_, readings_.front().t_s);
    return rotation_log_csv(config_.before ? joined_logs(*config_.before, now) : now);
  }
  /// Whoever kills this process finds what was measured until a few seconds ago.
  void tell_so_far() {
    constexpr double pause_s = 3.0;
    if (!config_.on_so_far || readings_.empty()) return;
    if (head_.now_s() - given_s_ < pause_s) return;
    given_s_ = head_.now_s();
    result_.log_csv = log_of(follower_.seen_so_far());
    result_.head_time_s = head_time();
    config_.on_so_far(result_);
  }

  /// Of an axis that is fixed nothing is determined until the end: to see whether something is costs most time.
  [[nodiscard]] bool determines_both_axes() const { return (reach_high() - reach_low()).minCoeff() > 0.5 * degree; }

  [[nodiscard]] bool is_reached() const {
    if (result_.report.quantities.size() < 2) return false;
    for (std::size_t i = 0; i < 2; ++i) {
      const ObservedQuantity& f = result_.report.quantities[i];
      if (config_.until && !(3.0 * f.sigma < *config_.until * f.value)) return false;
    }
    return true;
  }

  /// The two most informative moves by what is known; false: none is left within the limits.
  bool next_moves() {
    constexpr double min_way = 1.5 * degree;
    std::vector<NextMove> planned;
    try {
      const double rate_deg_s = std::clamp(rate_ / degree, 1.0, 60.0);
      planned = plan_moves(observed_now(result_.report), {.moves = 2, .rate_deg_s = rate_deg_s, .max_turn_deg = 20.0},
                           progress_)
                    .moves;
    } catch (const ConfigError&) {  // no estimate yet: where it has not been
    }
    std::vector<Eigen::Vector2d> targets;
    const Eigen::Vector2d here = at();
    for (const NextMove& move : planned) targets.push_back(here + move.pan_tilt_roll_rad.head<2>());
    // Where the plan would not leave the position, and to see old points again: around the centre.
    const Eigen::Vector2d centre = 0.5 * (reach_low() + reach_high()), half = 0.5 * (reach_high() - reach_low());
    static constexpr std::array<std::array<double, 2>, 4> corners{{{1, 1}, {-1, -0.6}, {-1, 1}, {1, -0.6}}};
    const auto& corner = corners[num_corners_++ % corners.size()];
    targets.push_back(centre + half.cwiseProduct(Eigen::Vector2d(corner[0], corner[1])));
    bool has_moved = false;
    for (Eigen::Vector2d target : targets) {
      target = within(target);
      if ((target - at()).norm() < min_way || left_s() < 0.0) continue;
      move_to(target);
      has_moved = true;
    }
    return has_moved;
  }
  [[nodiscard]] Eigen::Vector2d reach_low() const {
    Eigen::Vector2d low = readings_.front().pan_tilt_rad;
    for (const HeadPosition& each : readings_) low = low.cwiseMin(each.pan_tilt_rad);
    return low;
  }
  [[nodiscard]] Eigen::Vector2d reach_high() const {
    Eigen::Vector2d high = readings_.front().pan_tilt_rad;
    for (const HeadPosition& each : readings_) high = high.cwiseMax(each.pan_tilt_rad);
    return high;
  }

  static constexpr double piece_s = 0.1, silent_s = 1.2, least_rest_s = 0.45;
  MovingHead& head_;
  FrameStream& stream_;
  const HeadCalibrationConfig& config_;
  const Progress& progress_;
  HeadCalibration& result_;
  FrameFollower follower_;
  std::optional<BoardReach> reach_;  ///< With a board.
  std::vector<HeadPosition> readings_;
  double estimate_s_ = 0.0;  ///< What the last one took: the head is not kept for one that ends too late.
  double begin_s_ = 0.0, next_s_ = 0.0, last_frame_s_ = 0.0, given_s_ = 0.0, rate_ = 0.0, late_s_ = 0.0,
         focal_px_ = 0.0;
  std::size_t num_corners_ = 0;
};

}  // namespace

HeadCalibration calibrate_head(HeadDevice& device, FrameStream& stream, const HeadCalibrationConfig& config,
                               const Progress& progress) {
  HeadCalibration result;
  result.url = device.name();
  result.stream = stream.name();
  Eigen::Vector2d span;
  {
    MovingHead head(device, config.range.low_rad, config.range.high_rad, progress);
    if ((head.high_rad() - head.low_rad()).maxCoeff() > 1e4)
      throw InputError(device.name() + ": names no limits; give --pan-range and --tilt-range");
    span = head.high_rad() - head.low_rad();
    if (stream.exposure_s() > 0.0) {
      calibrate_by_shots(head, stream, config, progress, result);
    } else {
      Session(head, stream, config, progress, result).run();
    }
  }
  heed_noise_of_readings(result);
  result.offline = offline_words(result);
  result.verdict = calibration_verdict(result, config, span);
  return result;
}

}  // namespace alidade
