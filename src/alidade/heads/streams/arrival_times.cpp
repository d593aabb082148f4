#include "alidade/heads/streams/arrival_times.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "alidade/estimation/median.h"

namespace alidade {
namespace {

constexpr std::size_t window = 240, fewest = 12;

}  // namespace

void ArrivalTimes::restart() {
  arrivals_.clear();
  num_late_ = 0;
}

/// The lower hull by A. M. Andrew's monotone chain, 1979; ticks rise.
std::optional<ArrivalTimes::Line> ArrivalTimes::line_under(double at_tick) const {
  if (arrivals_.size() < fewest) return std::nullopt;
  std::vector<Arrival> hull;
  double mean_tick = 0.0;
  for (const Arrival& next : arrivals_) {
    while (hull.size() > 1) {
      const Arrival &a = hull[hull.size() - 2], &b = hull.back();
      const double cross = (b.tick - a.tick) * (next.came_s - a.came_s) - (b.came_s - a.came_s) * (next.tick - a.tick);
      if (cross > 0.0) break;
      hull.pop_back();
    }
    hull.push_back(next);
    mean_tick += next.tick / static_cast<double>(arrivals_.size());
  }
  std::size_t edge = 1;
  while (edge + 1 < hull.size() && hull[edge].tick < mean_tick) ++edge;
  const Arrival &a = hull[edge - 1], &b = hull[edge];
  Line line{0.0, (b.came_s - a.came_s) / (b.tick - a.tick), 0.0};
  line.value = a.came_s + line.slope * (at_tick - a.tick);
  for (const Arrival& each : arrivals_)
    line.mean_delay += (each.came_s - a.came_s - line.slope * (each.tick - a.tick)) / static_cast<double>(window);
  line.mean_delay *= static_cast<double>(window) / static_cast<double>(arrivals_.size());
  return line;
}

FilteredTime ArrivalTimes::add(double came_s, std::optional<double> tick) {
  constexpr double machine_s = 2e-4, unknown_s = 0.02;
  constexpr std::size_t max_late = 12;
  const double at = tick.value_or(count_);
  count_ += 1.0;
  if (!arrivals_.empty() && !(at > arrivals_.back().tick)) restart();
  const std::optional<Line> before = line_under(at);
  // Late for long by more than a frame's time: frames were lost, or the sender's clock was set.
  const double patience_s =
      before ? std::max(0.75 * (tick ? 0.0 : before->slope), 10.0 * before->mean_delay + 0.01) : 0;
  num_late_ = before && came_s - before->value > patience_s ? num_late_ + 1 : 0;
  if (num_late_ > max_late || (before && came_s < before->value - 1.0)) restart();
  arrivals_.push_back({at, came_s});
  if (arrivals_.size() > window) arrivals_.pop_front();
  const std::optional<Line> line = line_under(at);
  if (!line) return {came_s, unknown_s};
  const bool is_uneven = !tick && line->mean_delay > 2.0 * line->slope;  // no clock stands behind the count
  if (is_uneven) return {came_s, line->mean_delay};
  // The end of a line whose two points lie above the truth by about an N-th of the mean delay, drawn out from there.
  const double n = static_cast<double>(arrivals_.size());
  return {std::min(line->value, came_s), std::hypot(machine_s, 5.0 * line->mean_delay / n)};
}

void StampWatch::add(double stamp_s, double came_s) {
  constexpr std::size_t max_periods = 31, fewest_periods = 5, max_offsets = 6;
  constexpr double min_s = 0.1;
  const std::optional<double> stamp_before = std::exchange(stamp_s_, stamp_s),
                              came_before = std::exchange(came_s_, came_s);
  const double usual_offset_s = offsets_s_.empty() ? 0.0 : *std::ranges::min_element(offsets_s_);
  offsets_s_.push_back(came_s - stamp_s);
  if (offsets_s_.size() > max_offsets) offsets_s_.pop_front();
  if (!stamp_before) return;
  const double way_s = stamp_s - *stamp_before, wait_s = came_s - *came_before;
  periods_s_.push_back(wait_s);
  if (periods_s_.size() > max_periods) periods_s_.pop_front();
  if (periods_s_.size() < fewest_periods) return;
  const double period_s = median_of(std::vector<double>(periods_s_.begin(), periods_s_.end()));
  const bool came_in_turn = std::abs(wait_s - period_s) < 0.5 * period_s;
  came_in_turn_ = wait_s > 0.3 * period_s && wait_s < 2.0 * period_s;
  const double off_s = std::abs(way_s - wait_s);
  const bool is_off = way_s <= 0.0 || off_s > std::max(min_s, 1.5 * period_s);
  if (is_off || !came_in_turn_) ++piece_;
  // One that was held back, and the next that was not: only the first is out of what is usual.
  const bool is_made_up_for = way_s > wait_s && std::abs(offsets_s_.back() - usual_offset_s) < min_s;
  if (!is_off || is_made_up_for || (way_s > 0.0 && !came_in_turn)) return;
  ++num_jumps_;
  largest_s_ = std::max(largest_s_, off_s);
}

PiecedTimes pieced_times(std::span<const JumpingStamp> frames) {
  struct Piece {
    double min_s = 1e300, sum_s = 0.0, count = 0.0;
  };
  std::map<std::size_t, Piece> pieces;
  for (const JumpingStamp& frame : frames) {
    if (!frame.came_in_turn) continue;
    Piece& piece = pieces[frame.piece];
    piece.min_s = std::min(piece.min_s, frame.came_s - frame.stamp_s);
    piece.sum_s += frame.came_s - frame.stamp_s;
    piece.count += 1.0;
  }
  constexpr double fewest_frames = 4.0;
  PiecedTimes times;
  double variance = 0.0, num = 0.0;
  for (const JumpingStamp& frame : frames) {
    const Piece& piece = pieces[frame.piece];
    if (!frame.came_in_turn || piece.count < fewest_frames) {
      times.t_s.push_back(std::nan(""));
      continue;
    }
    num += 1.0;
    times.t_s.push_back(frame.stamp_s + piece.min_s);
    // The least of n delays lies above the truth by about an n-th of their mean.
    variance += std::pow((piece.sum_s / piece.count - piece.min_s) / piece.count, 2);
  }
  constexpr double machine_s = 2e-4;
  times.sigma_s = std::hypot(machine_s, std::sqrt(variance / std::max(1.0, num)));
  return times;
}

}  // namespace alidade
