#include "alidade/heads/turn_log.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "alidade/estimation/median.h"
#include "alidade/geometry/degree.h"

namespace alidade {
namespace {

constexpr double margin_s = 0.08;  // around what is used: a corner beside it curves the line
constexpr double still_rad = 1e-9;

/// The readings that end before and begin after that time, and all between; empty where there are none.
std::span<const HeadPosition> readings_around(std::span<const HeadPosition> readings, double from_s, double until_s) {
  const auto answered_s = [](const HeadPosition& each) { return each.t_s + 0.5 * each.wait_s; };
  const auto asked_s = [](const HeadPosition& each) { return each.t_s - 0.5 * each.wait_s; };
  const auto begin = std::ranges::upper_bound(readings, from_s, {}, answered_s);
  const auto end = std::ranges::lower_bound(readings, until_s, {}, asked_s);
  if (begin == readings.begin() || end == readings.end()) return {};
  return {begin - 1, end + 1};
}

/// Where it stands: all readings around are the same, and none is too far from the next to say so.
std::optional<HeadLine> at_rest(std::span<const HeadPosition> readings, double from_s, double until_s) {
  constexpr double longest_gap_s = 2.5;
  const std::span<const HeadPosition> near = readings_around(readings, from_s - margin_s, until_s + margin_s);
  for (std::size_t i = 0; i < near.size(); ++i) {
    if ((near[i].pan_tilt_rad - near.front().pan_tilt_rad).cwiseAbs().maxCoeff() >= still_rad) return std::nullopt;
    if (i > 0 && near[i].t_s - near[i - 1].t_s > longest_gap_s) return std::nullopt;
  }
  if (near.empty()) return std::nullopt;
  return HeadLine{near.front().pan_tilt_rad, Eigen::Vector2d::Zero()};
}

/// Of one axis, least squares.
struct Line {
  double value = 0.0, slope = 0.0, worst = 0.0;
  double bend = 0.0;  ///< What the central third lies off it, less the outer two.
};
Line line_through(std::span<const HeadPosition> readings, int axis, double t_s) {
  const double n = static_cast<double>(readings.size());
  double st = 0.0, sy = 0.0, stt = 0.0, sty = 0.0;
  for (const HeadPosition& each : readings) {
    const double t = each.t_s - t_s, y = each.pan_tilt_rad[axis];
    st += t;
    sy += y;
    stt += t * t;
    sty += t * y;
  }
  const double determinant = n * stt - st * st;
  Line line;
  line.slope = determinant > 0.0 ? (n * sty - st * sy) / determinant : 0.0;
  line.value = (sy - line.slope * st) / n;
  const std::size_t third = readings.size() / 3;
  double middle = 0.0, outer = 0.0;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const double off = readings[i].pan_tilt_rad[axis] - line.value - line.slope * (readings[i].t_s - t_s);
    line.worst = std::max(line.worst, std::abs(off));
    (i >= third && i < readings.size() - third ? middle : outer) += off;
  }
  const double num_outer = 2.0 * static_cast<double>(third);
  if (third > 0) line.bend = middle / (n - num_outer) - outer / num_outer;
  return line;
}

/// The longest seen, and how many frames each must have.
std::map<int, std::size_t> columns_of(std::span<const SeenFrame> frames) {
  constexpr std::size_t min_rows = 4, max_points = 400;
  std::map<int, std::size_t> seen;
  for (const SeenFrame& frame : frames)
    for (const TrackedPoint& point : frame.points) ++seen[point.id];
  std::erase_if(seen, [](const auto& each) { return each.second < min_rows; });
  std::vector<std::pair<int, std::size_t>> longest(seen.begin(), seen.end());
  std::ranges::stable_sort(longest, [](const auto& a, const auto& b) { return a.second > b.second; });
  longest.resize(std::min(longest.size(), max_points));
  std::map<int, std::size_t> columns;
  for (const auto& [id, count] : longest) columns[id] = 0;
  std::size_t next = 0;
  for (auto& [id, column] : columns) column = next++;
  return columns;
}

}  // namespace

HeadManner manner_of(std::span<const HeadPosition> readings) {
  constexpr double same_rad = 1e-9, min_s = 0.1;
  HeadManner manner;
  std::vector<double> gaps_s;
  for (std::size_t i = 1; i < readings.size(); ++i) gaps_s.push_back(readings[i].t_s - readings[i - 1].t_s);
  if (!gaps_s.empty()) manner.period_s = median_of(std::move(gaps_s));
  for (int axis = 0; axis < 2; ++axis) {
    for (std::size_t i = 1, from = 0; i < readings.size(); ++i) {
      const double apart = std::abs(readings[i].pan_tilt_rad[axis] - readings[i - 1].pan_tilt_rad[axis]);
      if (apart > same_rad && (manner.step_rad[axis] == 0.0 || apart < manner.step_rad[axis]))
        manner.step_rad[axis] = apart;
      while (readings[i].t_s - readings[from + 1].t_s >= min_s) ++from;
      const double dt = readings[i].t_s - readings[from].t_s;
      if (dt < min_s) continue;
      const double rate = std::abs(readings[i].pan_tilt_rad[axis] - readings[from].pan_tilt_rad[axis]) / dt;
      manner.fastest_rad_s[axis] = std::max(manner.fastest_rad_s[axis], rate);
    }
  }
  return manner;
}

std::optional<HeadLine> even_motion(std::span<const HeadPosition> readings, const HeadManner& manner, double t_s,
                                    double from_s, double until_s) {
  constexpr std::ptrdiff_t least = 4;
  constexpr double most_apart_s = 0.02, clock_s = 3e-4, slow = 0.25;
  if (const std::optional<HeadLine> rest = at_rest(readings, from_s, until_s)) return rest;
  const double around_s = std::max(margin_s, 0.5 * least * manner.period_s);
  const auto begin = std::ranges::lower_bound(readings, from_s - around_s, {}, &HeadPosition::t_s);
  const auto end = std::ranges::upper_bound(readings, until_s + around_s, {}, &HeadPosition::t_s);
  if (begin == readings.begin() || end == readings.end() || end - begin < least) return std::nullopt;
  // One more on each side: what begins between two readings shows in the next.
  const std::span<const HeadPosition> near(begin - 1, end + 1);
  const auto [quickest, slowest] = std::ranges::minmax_element(near, {}, &HeadPosition::wait_s);
  if (slowest->wait_s - quickest->wait_s > most_apart_s) return std::nullopt;
  HeadLine result;
  for (int axis = 0; axis < 2; ++axis) {
    const Line line = line_through(near, axis, t_s);
    const double first = near.front().pan_tilt_rad[axis];
    const bool is_still = std::ranges::all_of(
        near, [&](const HeadPosition& each) { return std::abs(each.pan_tilt_rad[axis] - first) < still_rad; });
    // What creeps is coming to rest, and on no straight line.
    const bool creeps = std::abs(line.slope) < slow * manner.fastest_rad_s[axis];
    const double most = 0.8 * manner.step_rad[axis] + clock_s * std::abs(line.slope);
    const bool bends = std::abs(line.bend) > 0.35 * manner.step_rad[axis] + 0.3 * clock_s * std::abs(line.slope);
    if (!is_still && (creeps || bends || line.worst > most)) return std::nullopt;
    result.pan_tilt_rad[axis] = is_still ? first : line.value;
    result.rate_rad_s[axis] = is_still ? 0.0 : line.slope;
  }
  return result;
}

namespace {

constexpr double before_s = 0.01;  ///< Between the rows of a frame.

/// Frames whose angles are known, with the motion there.
struct MovingFrames {
  std::vector<SeenFrame> frames;
  std::vector<HeadLine> lines;
};

/// Of each rest some: what lies between two may all be of uneven motion.
MovingFrames known_frames(std::span<const HeadPosition> readings, std::span<const SeenFrame> frames, double late_s) {
  constexpr double same_place_rad = 1e-4;
  constexpr int max_at_rest = 6;
  const HeadManner manner = manner_of(readings);
  MovingFrames kept;
  int at_rest = 0;
  Eigen::Vector2d rested_rad = Eigen::Vector2d::Constant(not_seen);
  for (const SeenFrame& frame : frames) {
    const double shown_s = frame.t_s - late_s;
    const auto line =
        even_motion(readings, manner, frame.t_s, std::min(frame.t_s, shown_s), std::max(frame.t_s, shown_s));
    if (!line || frame.points.empty()) continue;
    if (!kept.frames.empty() && frame.t_s - kept.frames.back().t_s < 3.0 * before_s) continue;
    const bool rests_on = line->rate_rad_s.isZero() && (line->pan_tilt_rad - rested_rad).norm() < same_place_rad;
    at_rest = rests_on ? at_rest + 1 : line->rate_rad_s.isZero() ? 1 : 0;
    rested_rad = line->rate_rad_s.isZero() ? line->pan_tilt_rad : Eigen::Vector2d::Constant(not_seen);
    if (at_rest > max_at_rest) continue;
    kept.frames.push_back(frame);
    kept.lines.push_back(*line);
  }
  return kept;
}

}  // namespace

RotationLog turn_log(std::span<const HeadPosition> readings, std::span<const SeenFrame> frames, double late_s,
                     double origin_s) {
  RotationLog log;
  log.source = RotationSource::head;
  if (readings.size() < 2) return log;
  const MovingFrames kept = known_frames(readings, frames, late_s);
  const std::map<int, std::size_t> columns = columns_of(kept.frames);
  log.num_points = columns.size();
  for (std::size_t i = 0; i < kept.frames.size(); ++i) {
    for (int k = 2; k >= 0; --k) {
      RotationRow row;
      row.t_s = kept.frames[i].t_s - before_s * k - origin_s;
      const Eigen::Vector2d angles = kept.lines[i].pan_tilt_rad - before_s * k * kept.lines[i].rate_rad_s;
      row.pan_tilt_roll_rad = Eigen::Vector3d(angles[0], angles[1], 0.0);
      row.px.assign(columns.size(), Eigen::Vector2d::Constant(not_seen));
      for (const TrackedPoint& point : kept.frames[i].points)
        if (const auto column = columns.find(point.id); k == 0 && column != columns.end())
          row.px[column->second] = point.px;
      log.rows.push_back(std::move(row));
    }
  }
  return log;
}

}  // namespace alidade
