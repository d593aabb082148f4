#pragma once

#include <cstddef>
#include <deque>
#include <optional>

namespace alidade {

/// A time and how well it is known.
struct FilteredTime {
  double t_s = 0.0, sigma_s = 0.0;
};

/// When frames were taken, but for a constant, from when they came: a network only delays, so the line under all
/// arrivals over the frames' own count (or clock) is that of the fastest. Of all lines below them the one that lies
/// closest on average is an edge of their convex hull. S. B. Moon, P. Skelly & D. Towsley, "Estimation and removal of
/// clock skew from network delay measurements", 1999.
class ArrivalTimes {
 public:
  /// `tick`: of the sender's clock, s; none: frames are counted, as of a camera with an even rate. Never later than
  /// `came_s`. A stream that lost frames, or began anew, is found out by its delays and starts a new line.
  [[nodiscard]] FilteredTime add(double came_s, std::optional<double> tick = {});

 private:
  struct Arrival {
    double tick, came_s;
  };
  struct Line {
    double value, slope, mean_delay;
  };
  [[nodiscard]] std::optional<Line> line_under(double at_tick) const;
  void restart();

  std::deque<Arrival> arrivals_;
  double count_ = 0.0;
  std::size_t num_late_ = 0;
};

/// Whether a stream's time stamps are those of a clock: they jump where they go back, or where a frame that came in its
/// turn is stamped as if it had not.
class StampWatch {
 public:
  void add(double stamp_s, double came_s);
  [[nodiscard]] std::size_t num_jumps() const { return num_jumps_; }
  [[nodiscard]] double largest_s() const { return largest_s_; }
  /// More than once: such stamps are of no use.
  [[nodiscard]] bool is_jumping() const { return num_jumps_ > 1; }

 private:
  std::optional<double> stamp_s_, came_s_;
  std::deque<double> periods_s_;
  std::size_t num_jumps_ = 0;
  double largest_s_ = 0.0;
};

}  // namespace alidade
