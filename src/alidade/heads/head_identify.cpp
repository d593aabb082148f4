#include "alidade/heads/head_identify.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "alidade/files/files.h"
#include "alidade/geometry/degree.h"

namespace alidade {
namespace {

constexpr double question_s = 0.045;    // a head that moves only while it is not asked is asked half as often as it may
constexpr double longest_move_s = 5.0;  // of a slow head
constexpr double widest_rad = 125.0 * degree;

/// Thrown where the head does what makes all further moves useless.
struct HeadLies {
  std::string what;
};

/// Thrown where an axis may not go far enough to show anything.
struct TooLittleRoom {
  std::array<bool, 2> axes;
};

constexpr double long_way_rad = 1.9 * degree;  // far beyond any dead band

/// One head, moved step by step, and what it reads meanwhile.
class Experiment {
 public:
  Experiment(MovingHead& head, HeadIdentification& result, const Progress& progress)
      : head_(head), result_(result), progress_(progress) {
    head_.on_reading = [this](const HeadPosition& reading) {
      for (int i = 0; i < 2; ++i) log(i).readings.push_back({reading.t_s, reading.wait_s, reading.pan_tilt_rad[i]});
    };
    head_.on_command = [this](const HeadSent& sent, const Eigen::Vector2d& target) {
      for (int i = 0; i < 2; ++i) {
        log(i).commands.push_back({sent.t_s, target[i]});
        log(i).command_waits_s.push_back(sent.wait_s);
      }
    };
  }
  ~Experiment() { head_.on_reading = nullptr, head_.on_command = nullptr; }
  Experiment(const Experiment&) = delete;
  Experiment& operator=(const Experiment&) = delete;

  void run() {
    begin_s_ = head_.now_s();
    ask_for(0.4);
    start_ = last().pan_tilt_rad;
    place_window();
    try {
      wake();
      steps();
      chirp();
      const double until_s = head_.now_s();
      for (PositionerLog& each : result_.logs) each.used_until_s = until_s;
      small_steps();
      repeat();
      move_to(start_.cwiseMax(head_.low_rad()).cwiseMin(head_.high_rad()));
      result_.zoom = try_zoom(head_);
    } catch (const HeadLies& lie) {
      result_.lie = lie.what;
    } catch (const TooLittleRoom& room) {
      result_.cramped = room.axes;
    }
    head_.stop();
    result_.head_time_s = head_.now_s() - begin_s_;
  }

 private:
  PositionerLog& log(int i) { return result_.logs[static_cast<std::size_t>(i)]; }
  [[nodiscard]] HeadPosition last() {
    const PositionerReading &pan = log(0).readings.back(), &tilt = log(1).readings.back();
    return {pan.t_s, pan.wait_s, {pan.angle_rad, tilt.angle_rad}};
  }
  double draw() {  // of a sequence without a period: questions shall not keep step with the encoder
    constexpr double golden = 0.6180339887498949;
    chance_ = std::fmod(chance_ + golden, 1.0);
    return chance_;
  }

  void ask() {
    report_progress(progress_, "identifying: s of head time", static_cast<std::size_t>(head_.now_s() - begin_s_), 0);
    head_.wait_until(next_s_);
    (void)head_.position();
    next_s_ = head_.now_s() + question_s * (0.6 + 0.8 * draw());
  }
  void ask_for(double seconds) {
    for (const double until = head_.now_s() + seconds; head_.now_s() < until;) ask();
  }
  /// Asks until both axes have stood still for so long, after they had the time to begin.
  void ask_until_rest(double min_s, double still_s) {
    const double begin = head_.now_s(), most = 4.0 * longest_move_s;
    double still_since = begin;
    Eigen::Vector2d before = last().pan_tilt_rad;
    while (head_.now_s() - begin < most) {
      ask();
      const Eigen::Vector2d now = last().pan_tilt_rad;
      if (now != before) still_since = head_.now_s();
      before = now;
      if (head_.now_s() - begin >= min_s && head_.now_s() - still_since >= still_s) return;
    }
  }
  void send(const Eigen::Vector2d& target) {
    head_.wait_until(next_s_);
    head_.command(target.cwiseMax(low_).cwiseMin(high_));
    next_s_ = head_.now_s() + question_s;
  }
  void move_to(const Eigen::Vector2d& target) {
    if (still_s_ > quick_still_s) ask_for(0.67 * still_s_ * draw());  // no command keeps step with the renewals
    const Eigen::Vector2d before = last().pan_tilt_rad;
    const std::size_t first = log(0).readings.size();
    send(target);
    ask_until_rest(patience_s_, still_s_);
    heed_renewals(first);
    for (int i = 0; i < 2; ++i) heed_standing(i, before[i], first);
  }
  /// A reading may be renewed less often than it is asked (a camera's cached status): rest is only known after longer
  /// than that. Until a move has shown how it is, long.
  void heed_renewals(std::size_t first) {
    constexpr int few = 4;
    constexpr double times = 1.5;
    for (int i = 0; i < 2; ++i) {
      const std::vector<PositionerReading>& readings = log(i).readings;
      int changes = 0;
      double last_s = 0.0;
      for (std::size_t k = std::max<std::size_t>(first, 1); k < readings.size(); ++k) {
        if (readings[k].angle_rad == readings[k - 1].angle_rad) continue;
        if (++changes > 1) held_s_ = std::max(held_s_, readings[k].t_s - last_s);
        last_s = readings[k].t_s;
      }
      shows_renewals_ = shows_renewals_ || changes >= few;
    }
    still_s_ = shows_renewals_ ? std::clamp(times * held_s_, quick_still_s, slow_still_s) : slow_still_s;
  }
  /// A reading that stands through several commands, each far beyond any dead band, is none.
  void heed_standing(int axis, double before, std::size_t first) {
    constexpr int most = 3;
    const PositionerLog& it = log(axis);
    const double way = it.commands.back().target_rad - before;
    const bool stands = std::all_of(it.readings.begin() + static_cast<std::ptrdiff_t>(first), it.readings.end(),
                                    [&](const PositionerReading& each) { return each.angle_rad == before; });
    int& count = num_standing_[static_cast<std::size_t>(axis)];
    if (!stands) count = 0;
    if (!stands || std::abs(way) < long_way_rad || ++count < most) return;
    throw HeadLies{
        fmt::format("{} reads {:.3f}° through {} commands of {:.1f}° and more, after it had moved: its reading "
                    "is frozen, or positions are refused silently",
                    head_axis_names[static_cast<std::size_t>(axis)], before / degree, most, long_way_rad / degree)};
  }

  /// The centre of what is free, no wider than is needed, and with the start in it.
  void place_window() {
    low_ = head_.low_rad();
    high_ = head_.high_rad();
    for (int i = 0; i < 2; ++i) {
      const double inside = std::clamp(start_[i], low_[i], high_[i]);
      const double wide = std::min(widest_rad, high_[i] - low_[i]);
      window_low_[i] = std::clamp(inside - 0.5 * wide, low_[i], high_[i] - wide);
      window_high_[i] = window_low_[i] + wide;
    }
  }

  /// A few degrees: how fast is it, roughly, and how late? What is not known yet is not used.
  void wake() {
    const Eigen::Vector2d span = window_high_ - window_low_;
    if (!(span.minCoeff() > 0.0)) throw TooLittleRoom{{!(span[0] > 0.0), !(span[1] > 0.0)}};
    Eigen::Vector2d in = start_.cwiseMax(window_low_).cwiseMin(window_high_);
    for (int i = 0; i < 2; ++i) toward_[i] = in[i] < 0.5 * (window_low_[i] + window_high_[i]) ? 1.0 : -1.0;
    const Eigen::Vector2d step = toward_.cwiseProduct(span.cwiseMin(6.0 * degree) * 0.5);
    patience_s_ = 0.7;
    const std::size_t begin = log(0).readings.size();
    move_to(in + step);
    heed_no_motion(step);
    for (int i = 0; i < 2; ++i) slow_rate_[i] = slowest_rate(log(i), begin);
    for (PositionerLog& axis : result_.logs) axis.used_from_s = head_.now_s();
  }
  /// A short step that is not followed may be within a dead band; a long one is not.
  void heed_no_motion(const Eigen::Vector2d& step) {
    std::array<bool, 2> is_still{};
    for (int i = 0; i < 2; ++i) {
      const std::vector<PositionerReading>& readings = log(i).readings;
      if (std::abs(readings.back().angle_rad - readings.front().angle_rad) >= 0.25 * std::abs(step[i])) continue;
      if (std::abs(step[i]) >= long_way_rad)
        throw HeadLies{fmt::format(
            "{} took a command of {:.2f}° and did not move: positions are refused silently, or its reading is frozen",
            head_axis_names[static_cast<std::size_t>(i)], std::abs(step[i]) / degree)};
      is_still[static_cast<std::size_t>(i)] = true;
    }
    if (is_still[0] || is_still[1]) throw TooLittleRoom{is_still};
  }
  /// Of a move of 3°: the mean while it moved.
  static double slowest_rate(const PositionerLog& axis, std::size_t begin) {
    const double from = axis.readings[begin].angle_rad, way = axis.readings.back().angle_rad - from;
    double first = 0.0, second = 1e9;
    for (std::size_t i = begin; i < axis.readings.size(); ++i) {
      const double share = (axis.readings[i].angle_rad - from) / way;
      if (share < 0.2) first = axis.readings[i].t_s;
      if (share > 0.8) {
        second = axis.readings[i].t_s;
        break;
      }
    }
    return std::abs(0.6 * way) / std::max(0.05, second - first);
  }

  /// Shares of the window, and where from there by degrees: long ways for the rate, short ones for all else.
  void steps() {
    static constexpr std::array<std::array<double, 2>, 9> small{{{2.3, 1.7},
                                                                 {-1.1, -3.1},
                                                                 {3.9, 2.9},
                                                                 {-2.7, -1.3},
                                                                 {5.3, 6.1},
                                                                 {-8.3, -7.1},
                                                                 {11.9, 9.7},
                                                                 {-3.3, 4.3},
                                                                 {1.4, -2.2}}};
    Eigen::Vector2d at = last().pan_tilt_rad;
    for (const auto& way : small) {
      Eigen::Vector2d next = at + Eigen::Vector2d(way[0], way[1]).cwiseProduct(toward_) * degree;
      for (int i = 0; i < 2; ++i)  // out of the window: the other way
        if (next[i] < window_low_[i] || next[i] > window_high_[i]) next[i] = 2.0 * at[i] - next[i];
      at = next.cwiseMax(window_low_).cwiseMin(window_high_);
      move_to(at);
    }
    static constexpr std::array<std::array<double, 2>, 5> large{
        {{0.012, 0.985}, {0.987, 0.014}, {0.021, 0.973}, {0.62, 0.41}, {0.37, 0.66}}};
    for (const auto& share : large) {
      Eigen::Vector2d next;
      for (int i = 0; i < 2; ++i) {
        const double goal = window_low_[i] + share[static_cast<std::size_t>(i)] * (window_high_[i] - window_low_[i]);
        const double most = std::max(6.0 * degree, longest_move_s * fastest_so_far(i));
        next[i] = at[i] + std::clamp(goal - at[i], -most, most);
      }
      at = next;
      move_to(at);
    }
  }
  double fastest_so_far(int i) {
    double fastest = slow_rate_[i];
    const auto& readings = log(i).readings;
    for (std::size_t k = 5; k < readings.size(); ++k) {
      const double dt = readings[k].t_s - readings[k - 5].t_s;
      if (dt > 0.1) fastest = std::max(fastest, std::abs(readings[k].angle_rad - readings[k - 5].angle_rad) / dt);
    }
    return fastest;
  }

  /// Quicker and quicker, and smaller and smaller, so that it follows.
  void chirp() {
    constexpr double duration_s = 10.0, from_hz = 0.15, to_hz = 1.2, command_s = 0.21;
    const Eigen::Vector2d centre = last().pan_tilt_rad;
    Eigen::Vector2d reach;
    for (int i = 0; i < 2; ++i)
      reach[i] =
          std::min({12.0 * degree, 0.5 * fastest_so_far(i), centre[i] - window_low_[i], window_high_[i] - centre[i]});
    const double begin = head_.now_s();
    for (double t = 0.0; t < duration_s; t = head_.now_s() - begin) {
      const double phase = 2.0 * std::numbers::pi * (from_hz * t + 0.5 * (to_hz - from_hz) * t * t / duration_s);
      const double size = from_hz / (from_hz + (to_hz - from_hz) * t / duration_s);
      send(centre + reach.cwiseMax(0.0).cwiseProduct(Eigen::Vector2d(std::sin(phase), std::cos(phase) - 1.0) * size));
      ask_for(command_s);
    }
    move_to(centre);
  }

  /// Halves the step, each axis by itself, until the smallest that is obeyed is known to a tenth. An axis that has no
  /// room left stands, and the other goes on.
  void small_steps() {
    constexpr int trials = 9;
    const Eigen::Vector2d grain(reading_step(log(0).readings), reading_step(log(1).readings));
    Eigen::Vector2d ignored = Eigen::Vector2d::Zero(), obeyed(-1.0, -1.0), step(0.24 * degree, 0.24 * degree);
    step = step.cwiseMax(3.0 * grain);
    move_to(last().pan_tilt_rad + toward_ * 2.0 * degree);
    Eigen::Vector2d at = last_target();
    for (int trial = 0; trial < trials; ++trial) {
      const Eigen::Vector2d before = last().pan_tilt_rad;
      for (int i = 0; i < 2; ++i)
        if (at[i] + 2.0 * toward_[i] * step[i] < low_[i] || at[i] + 2.0 * toward_[i] * step[i] > high_[i])
          step[i] = 0.0;
      if (step.isZero(0.0)) return;
      at += toward_.cwiseProduct(step);
      move_to(at);
      for (int i = 0; i < 2; ++i) {
        if (step[i] == 0.0) continue;
        const bool moved = std::abs(last().pan_tilt_rad[i] - before[i]) > 0.4 * step[i];
        if (moved) {
          obeyed[i] = step[i];
          log(i).smallest_obeyed_rad = step[i];
        } else {
          ignored[i] = std::max(ignored[i], step[i]);
          log(i).largest_ignored_rad = ignored[i];
          at[i] -= toward_[i] * step[i];  // it rests where it was
        }
        step[i] = obeyed[i] < 0.0 ? 2.0 * step[i] : std::max(0.5 * (ignored[i] + obeyed[i]), 1.5 * grain[i]);
        if (ignored[i] == 0.0 && obeyed[i] > 0.0) step[i] = std::max(0.6 * obeyed[i], 1.5 * grain[i]);
      }
    }
  }
  Eigen::Vector2d last_target() { return {log(0).commands.back().target_rad, log(1).commands.back().target_rad}; }

  /// The same position from the same side.
  void repeat() {
    constexpr int times = 5;
    const Eigen::Vector2d target = last_target(), away = target - toward_ * 2.0 * degree;
    for (int k = 0; k < times; ++k) {
      move_to(away);
      move_to(target);
      for (int i = 0; i < 2; ++i) log(i).repeated_rad.push_back(last().pan_tilt_rad[i]);
    }
  }

  MovingHead& head_;
  HeadIdentification& result_;
  const Progress& progress_;
  static constexpr double quick_still_s = 0.35, slow_still_s = 1.2;
  double begin_s_ = 0.0, next_s_ = 0.0, chance_ = 0.3, patience_s_ = 0.7, still_s_ = slow_still_s;
  double held_s_ = 0.0;  ///< The longest that a reading stood between two changes in one move.
  bool shows_renewals_ = false;
  std::array<int, 2> num_standing_{};
  Eigen::Vector2d start_, low_, high_, window_low_, window_high_, toward_, slow_rate_;
};

}  // namespace

HeadIdentification identify_head(HeadDevice& device, const HeadRange& range, const Progress& progress) {
  HeadIdentification result;
  result.url = device.name();
  {
    MovingHead head(device, range.low_rad, range.high_rad, progress);
    if ((head.high_rad() - head.low_rad()).maxCoeff() > 1e4)
      throw InputError(device.name() + ": names no limits; give --pan-range and --tilt-range");
    result.low_rad = head.low_rad();
    result.high_rad = head.high_rad();
    const HeadLimits own = device.limits();
    for (int i = 0; i < 2; ++i)
      result.at_own_limits[static_cast<std::size_t>(i)] =
          result.low_rad[i] == own.low_rad[i] && result.high_rad[i] == own.high_rad[i];
    Experiment(head, result, progress).run();
  }
  const bool has_moved = result.lie.empty() && !result.cramped[0] && !result.cramped[1];
  for (std::size_t i = 0; i < 2 && has_moved; ++i) {
    report_progress(progress, "fitting: axis", i + 1, 2);
    result.axes[i] = fit_positioner(result.logs[i]);
  }
  result.verdict = head_verdict(result);
  return result;
}

}  // namespace alidade
