#include "alidade/observe/checks/standing_rows.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "alidade/estimation/median.h"
#include "alidade/geometry/degree.h"
#include "alidade/observe/rotation_frame.h"

namespace alidade {
namespace {

constexpr std::size_t fewest_rows = 5;

/// The measured orientation of the camera in each row.
class Looks {
 public:
  explicit Looks(const RotationLog& log) : log_(log) {
    constexpr double max_gap_s = 0.25;
    MotionReader reader(log.source, max_gap_s);
    for (const RotationRow& row : log.rows) frames_.push_back(reader.next(row));
  }

  /// Whether the camera has the same orientation as in row `first`, and most points have not moved.
  [[nodiscard]] bool stands(std::size_t first, std::size_t row) const {
    constexpr double near_rad = 0.1 * degree, near_px = 1.0;
    const RotationFrame &before = frames_[first], &now = frames_[row];
    if (before.px.empty() || now.px.empty() || now.starts_segment) return false;
    if (before.cam_from_start.angularDistance(now.cam_from_start) > near_rad) return false;
    std::vector<double> moved_px;
    for (std::size_t i = 0; i < log_.num_points; ++i)
      if (is_seen(before.px[i]) && is_seen(now.px[i])) moved_px.push_back((now.px[i] - before.px[i]).norm());
    return !moved_px.empty() && median_of(std::move(moved_px)) <= near_px;
  }

 private:
  const RotationLog& log_;
  std::vector<RotationFrame> frames_;
};

/// One coordinate of a point over a stop, without rows in which it was not seen.
std::vector<double> track_of(const RotationLog& log, const Stop& stop, std::size_t point, Eigen::Index axis) {
  std::vector<double> track;
  for (std::size_t k = stop.begin; k < stop.end; ++k)
    if (is_seen(log.rows[k].px[point])) track.push_back(log.rows[k].px[point][axis]);
  return track;
}

double sigma_within(const RotationLog& log, const std::vector<Stop>& stops) {
  std::vector<double> off;
  for (const Stop& stop : stops) {
    for (std::size_t i = 0; i < log.num_points; ++i) {
      for (const Eigen::Index axis : {0, 1}) {
        const std::vector<double> track = track_of(log, stop, i, axis);
        if (track.size() < fewest_rows) continue;
        const double middle = median_of(track);
        for (const double each : track) off.push_back(std::abs(each - middle));
      }
    }
  }
  return normal_from_mad * median_of(std::move(off));
}

/// One row that averages all rows of a stop.
RotationRow averaged(const RotationLog& log, const Stop& stop) {
  RotationRow row = log.rows[stop.middle()];
  if (log.source == RotationSource::head) {
    row.pan_tilt_roll_rad.setZero();
    for (std::size_t k = stop.begin; k < stop.end; ++k)
      row.pan_tilt_roll_rad += log.rows[k].pan_tilt_roll_rad / static_cast<double>(stop.size());
  }
  for (std::size_t i = 0; i < log.num_points; ++i) {
    row.px[i].setConstant(not_seen);
    for (const Eigen::Index axis : {0, 1})
      if (const auto track = track_of(log, stop, i, axis); !track.empty()) row.px[i][axis] = median_of(track);
  }
  return row;
}

}  // namespace

std::size_t StandingRows::num_rows() const {
  std::size_t num = 0;
  for (const Stop& stop : stops) num += stop.size();
  return num;
}

StandingRows standing_rows(const RotationLog& log) {
  StandingRows standing;
  const Looks looks(log);
  for (std::size_t begin = 0; begin < log.rows.size();) {
    std::size_t end = begin + 1;
    while (end < log.rows.size() && looks.stands(begin, end)) ++end;
    if (end - begin >= fewest_rows) standing.stops.push_back({begin, end});
    begin = end;
  }
  standing.sigma_within_px = sigma_within(log, standing.stops);
  return standing;
}

RotationLog with_each_stop_once(const RotationLog& log, const StandingRows& standing) {
  RotationLog once = log;
  for (const Stop& stop : standing.stops) {
    for (std::size_t k = stop.begin; k < stop.end; ++k)
      std::ranges::fill(once.rows[k].px, Eigen::Vector2d::Constant(not_seen));
    once.rows[stop.middle()] = averaged(log, stop);
  }
  return once;
}

double shared_within_stops(const ObserveSolution& each_once, const RotationLog& log, const StandingRows& standing) {
  constexpr double of_median = 0.5 * std::numbers::pi;  // variance of the median over that of the mean
  const Adjustment& reference = each_once.reference;
  double squares = 0.0, of_own = 0.0, num = 0.0;
  for (std::size_t i = 0; i < reference.bundle.observations.size(); ++i) {
    const double t_s = reference.bundle.frames[static_cast<std::size_t>(reference.bundle.observations[i].frame)].t_s;
    const auto stop = std::ranges::lower_bound(standing.stops, t_s - 1e-9, {},
                                               [&](const Stop& each) { return log.rows[each.middle()].t_s; });
    if (stop == standing.stops.end() || log.rows[stop->middle()].t_s > t_s + 1e-9) continue;
    if (!reference.solution.residuals[i].allFinite()) continue;
    squares += reference.solution.residuals[i].squaredNorm();
    of_own += 2.0 * of_median / static_cast<double>(stop->size());
    num += 2.0;
  }
  if (!(num > 0.0) || reference.solution.dof <= 0) return 0.0;
  const double left = 2.0 * static_cast<double>(reference.bundle.observations.size()) / reference.solution.dof;
  const double own = std::pow(standing.sigma_within_px, 2);
  const double shared = (std::pow(each_once.scale.scale, 2) * squares * left - of_own * own) / num;
  return shared > 0.0 ? shared / (shared + own) : 0.0;
}

Check standing_check(const ObserveSolution& each_once, const StandingRows& standing) {
  return {"stops",
          State::good,
          std::to_string(standing.num_rows()) + " rows are of " + std::to_string(standing.stops.size()) +
              " stops, and err by " + text_of(standing.sigma_within_px, 2) + " px within them, by " +
              text_of(each_once.sigma_px, 2) + " px from one to the next: each stop counts as one row",
          static_cast<double>(standing.stops.size()),
          0.0,
          "1",
          "residuals"};
}

}  // namespace alidade
