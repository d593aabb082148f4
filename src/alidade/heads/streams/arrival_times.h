#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <span>
#include <vector>

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
  /// `came_s`. A stream that lost frames, or began again, is found out by its delays and starts a new line.
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
  /// Counts on where stamp and arrival do not agree on how far two frames are apart, or the newest did not come in its
  /// turn: by a jump, or a network that held it back.
  [[nodiscard]] std::size_t piece() const { return piece_; }
  [[nodiscard]] bool came_in_turn() const { return came_in_turn_; }
  /// More than once: such stamps are of no use as they stand.
  [[nodiscard]] bool is_jumping() const { return num_jumps_ > 1; }

 private:
  std::optional<double> stamp_s_, came_s_;
  std::deque<double> periods_s_, offsets_s_;  ///< Of the newest: between arrivals; from stamp to arrival.
  std::size_t num_jumps_ = 0, piece_ = 0;
  bool came_in_turn_ = false;
  double largest_s_ = 0.0;
};

/// A frame by a clock that jumps now and then.
struct JumpingStamp {
  double stamp_s = 0.0, came_s = 0.0;
  std::size_t piece = 0;     ///< StampWatch::piece() after it.
  bool came_in_turn = true;  ///< Else its arrival says nothing.
};
/// When such frames were taken, but for a constant: between two jumps the stamps count, and pieces are put together by
/// the fastest arrival of each. NaN of those that did not
/// come in their turn, and in a piece of too few. σ: of them all.
struct PiecedTimes {
  std::vector<double> t_s;
  double sigma_s = 0.0;
};
[[nodiscard]] PiecedTimes pieced_times(std::span<const JumpingStamp> frames);

}  // namespace alidade
