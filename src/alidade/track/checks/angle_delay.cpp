#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "alidade/track/checks/track_assumed.h"

// Delay between angles and images: angles that were not read when the images were taken.

namespace alidade {
namespace {

constexpr std::array<const char*, 3> coordinate_names{"x_m", "y_m", "z_m"};

/// The readings of each head's encoders in temporal order.
class ReadingLog {
 public:
  ReadingLog(std::span<const TargetObservation> observations, std::size_t num_heads) : of_head_(num_heads) {
    for (const TargetObservation& each : observations)
      if (each.head < num_heads) of_head_[each.head].push_back({each.t_capture_s, each.pan_tilt_rad});
    for (auto& readings : of_head_) std::ranges::stable_sort(readings, {}, &Reading::t_s);
  }

  /// For each head, the reading nearest to that time, if there is one within a second.
  [[nodiscard]] std::vector<HeadReading> at(double t_s) const {
    std::vector<HeadReading> nearest;
    for (std::size_t h = 0; h < of_head_.size(); ++h) {
      const auto next = std::ranges::lower_bound(of_head_[h], t_s, {}, &Reading::t_s);
      const Reading* best = next != of_head_[h].end() ? &*next : nullptr;
      if (next != of_head_[h].begin() && (best == nullptr || t_s - (next - 1)->t_s < best->t_s - t_s))
        best = &*(next - 1);
      if (best != nullptr && std::abs(best->t_s - t_s) < near_s) nearest.push_back({h, best->pan_tilt_rad});
    }
    return nearest;
  }

  /// Rate at which a head's readings change at that time [rad/s], from
  /// the neighbouring readings; at the end of the log, from the last two.
  [[nodiscard]] Eigen::Vector2d rate(std::size_t head, double t_s) const {
    const auto& readings = of_head_[head];
    auto before = std::ranges::lower_bound(readings, t_s, {}, &Reading::t_s);
    auto after = std::ranges::upper_bound(readings, t_s, {}, &Reading::t_s);
    if (after == readings.end() && after != readings.begin()) --after;
    before = std::min(before, after);
    if (before != readings.begin()) --before;
    if (after == before) return Eigen::Vector2d::Zero();
    const double apart_s = after->t_s - before->t_s;
    if (!(apart_s > 0.0 && apart_s < near_s)) return Eigen::Vector2d::Zero();
    return (after->pan_tilt_rad - before->pan_tilt_rad) / apart_s;
  }

 private:
  static constexpr double near_s = 1.0;
  struct Reading {
    double t_s = 0.0;
    Eigen::Vector2d pan_tilt_rad;
  };
  std::vector<std::vector<Reading>> of_head_;
};

/// Shift of the target if all heads read their angles `delay_s` before their images. None if it is not determined.
std::optional<Eigen::Vector3d> moved_by_delay(const ReadingLog& log, std::span<const RigHead> heads,
                                              const TrackStep& step, double delay_s) {
  const auto by = meeting_sensitivity(heads, log.at(step.t_s), step.belief.x.head<3>(), step.belief.x.segment<3>(3));
  if (by.empty()) return std::nullopt;
  Eigen::Vector3d moved = Eigen::Vector3d::Zero();
  for (std::size_t h = 0; h < by.size(); ++h)
    if (by[h].size() > 0) moved += delay_s * by[h].middleCols<2>(pan_zero_param) * log.rate(h, step.t_s);
  return moved;
}

/// All heads read their angles before their images are taken: the target then appears where the rays with these angles
/// meet, a little in its past. Since the heads follow the target, no observation reveals this.
std::optional<Assumption> angles_before_images(const ReadingLog& log, std::span<const RigHead> heads,
                                               const TrackReport& report) {
  constexpr std::size_t max_steps = 40;
  constexpr double ordinary_delay_s = 0.001;
  Eigen::Vector3d moved2 = Eigen::Vector3d::Zero(), in_sigma2 = Eigen::Vector3d::Zero();
  double num = 0.0;
  for (std::size_t i = report.steps.size() / 10; i < report.steps.size(); i += 1 + report.steps.size() / max_steps) {
    const TrackStep& step = report.steps[i];
    if (!step.has_belief || !step.accepted) continue;
    const auto moved = moved_by_delay(log, heads, step, ordinary_delay_s);
    if (!moved) continue;
    moved2 += moved->cwiseAbs2();
    in_sigma2 += moved->cwiseAbs2().cwiseQuotient(step.belief.P.diagonal().head<3>());
    num += 1.0;
  }
  if (!(num > 0.0)) return std::nullopt;
  Eigen::Index worst = 0;
  in_sigma2.maxCoeff(&worst);
  return Assumption{.name = "angles (s)",
                    .value = std::nan(""),
                    .ordinary = ordinary_delay_s,
                    .moves = std::sqrt(in_sigma2[worst] / num),
                    .moved = coordinate_names[static_cast<std::size_t>(worst)],
                    .moved_by = std::sqrt(moved2[worst] / num),
                    .remedy =
                        "read the angles when the images are taken or interpolate them to these times, and say how "
                        "exactly: --sigma-clock"};
}

/// The largest of the heads' mean row intervals [s].
double row_spacing_s(std::span<const TargetObservation> observations, std::size_t num_heads) {
  double largest_s = 0.0;
  for (std::size_t h = 0; h < num_heads; ++h) {
    double first_s = std::numeric_limits<double>::infinity(), last_s = -first_s, num = 0.0;
    for (const TargetObservation& each : observations) {
      if (each.head != h) continue;
      first_s = std::min(first_s, each.t_capture_s);
      last_s = std::max(last_s, each.t_capture_s);
      num += 1.0;
    }
    if (num > 1.0) largest_s = std::max(largest_s, (last_s - first_s) / (num - 1.0));
  }
  return largest_s;
}

/// Effect of the most common delay of angles, that of reading them with the image before. Listed as one row, since no
/// observation reveals it while the heads follow the target.
Assumption angles_late_alike(const Assumption& angles, double row_s) {
  const double times = row_s / angles.ordinary;
  return {.name = "angles.late_alike",
          .value = 0.0,
          .ordinary = row_s,
          .moves = std::nan(""),
          .moved =
              "whether the angles of all heads were read when the images were taken no observations show as long "
              "as the heads follow the target: angles of one row earlier (" +
              text_of(1e3 * row_s, 2) + " ms) move it by " + text_of(1e3 * times * std::abs(angles.moved_by), 2) +
              " mm (" + text_of(times * angles.moves, 2) + "σ) in " + angles.moved.substr(0, 1)};
}

/// A shift of the target at a given time.
struct Move {
  double t_s = 0.0;
  Eigen::Vector3d moved;
};

/// Increases the covariance by the shift nearest in time.
void widen(const std::vector<Move>& moves, double t_s, Belief<6>& belief) {
  auto nearest = std::ranges::lower_bound(moves, t_s, {}, &Move::t_s);
  if (nearest == moves.end() || (nearest != moves.begin() && t_s - (nearest - 1)->t_s < nearest->t_s - t_s)) --nearest;
  belief.P.topLeftCorner<3, 3>() += nearest->moved * nearest->moved.transpose();
}

}  // namespace

std::vector<Assumption> angles_assumed(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                       const TrackReport& report, double sigma_s) {
  std::vector<Assumption> rows;
  auto row = angles_before_images(ReadingLog(observations, heads.size()), heads, report);
  if (!row) return rows;
  const double row_s = row_spacing_s(observations, heads.size());
  if (row_s > 0.0 && row->moves > 0.0) rows.push_back(angles_late_alike(*row, row_s));
  if (sigma_s > 0.0) {  // included in the covariance by count_angle_delay()
    for (Assumption& alike : rows) alike.sigma = sigma_s;
    row->moves *= sigma_s / row->ordinary;
    row->moved_by *= sigma_s / row->ordinary;
    row->sigma = sigma_s;
  }
  rows.insert(rows.begin(), std::move(*row));
  return rows;
}

void count_angle_delay(std::span<const TargetObservation> observations, std::span<const RigHead> heads, double sigma_s,
                       TrackReport& report) {
  constexpr std::size_t max_moves = 4000;  // the shift changes little between them
  const ReadingLog log(observations, heads.size());
  std::vector<Move> moves;
  for (std::size_t i = 0; i < report.steps.size(); i += 1 + report.steps.size() / max_moves) {
    const TrackStep& step = report.steps[i];
    if (!step.has_belief) continue;
    if (const auto moved = moved_by_delay(log, heads, step, sigma_s)) moves.push_back({step.t_s, *moved});
  }
  if (moves.empty()) return;
  std::ranges::stable_sort(moves, {}, &Move::t_s);
  for (TrackStep& step : report.steps) widen(moves, step.t_s, step.belief);
  for (PredictedStep& step : report.ahead) widen(moves, step.t_s, step.belief);
  for (PredictedStep& step : report.smoothed) widen(moves, step.t_s, step.belief);
}

void RecentReadings::add(const TargetObservation& observation) {
  std::vector<TargetObservation>& own = of_head_[observation.head];
  const auto at = std::ranges::upper_bound(own, observation.t_capture_s, {}, &TargetObservation::t_capture_s);
  own.insert(at, observation);
  if (own.size() > 2) own.erase(own.begin());
}

void RecentReadings::count_delay(std::span<const RigHead> heads, double sigma_s, double t_s, Belief<6>& belief) const {
  std::vector<TargetObservation> recent;
  for (const auto& own : of_head_) recent.insert(recent.end(), own.begin(), own.end());
  TrackStep step;
  step.t_s = t_s;
  step.belief = belief;
  if (const auto moved = moved_by_delay(ReadingLog(recent, heads.size()), heads, step, sigma_s))
    belief.P.topLeftCorner<3, 3>() += *moved * moved->transpose();
}

}  // namespace alidade
