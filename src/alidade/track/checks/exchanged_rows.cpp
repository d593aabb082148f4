#include <algorithm>
#include <cmath>
#include <vector>

#include "alidade/estimation/median.h"
#include "alidade/track/checks/explanation.h"

// Two heads' numbers that are exchanged for a while: there the rays meet if each row is assigned to the other head.

namespace alidade {
namespace {

/// A row of one of two heads with its ray as labelled, and as seen from the other head.
struct TwoRays {
  double t_s = 0.0;
  bool is_second = false;
  WorldRay own, other;
};

/// The rows of two heads in temporal order.
std::vector<TwoRays> two_rays(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                              std::size_t a, std::size_t b) {
  std::vector<TwoRays> rows;
  for (const TargetObservation& one : observations) {
    if (one.head != a && one.head != b) continue;
    const auto own = ray_in_world(heads[one.head], one), other = ray_in_world(heads[one.head == a ? b : a], one);
    if (own && other) rows.push_back({one.t_capture_s, one.head == b, *own, *other});
  }
  std::ranges::stable_sort(rows, {}, &TwoRays::t_s);
  return rows;
}

/// Angle by which two rays miss each other, seen from the mean of their origins; π if they meet behind one of them.
double miss_rad(const WorldRay& a, const WorldRay& b) {
  constexpr double never = 3.14, parallel = 1e-9;
  const Eigen::Vector3d apart = b.origin_in_world - a.origin_in_world;
  const double along = a.direction_in_world.dot(b.direction_in_world), sine2 = 1.0 - along * along;
  if (sine2 < parallel) return never;
  const double to_a = (apart.dot(a.direction_in_world) - along * apart.dot(b.direction_in_world)) / sine2;
  const double to_b = (along * apart.dot(a.direction_in_world) - apart.dot(b.direction_in_world)) / sine2;
  if (!(to_a > 0.0) || !(to_b > 0.0)) return never;
  return (apart + to_b * b.direction_in_world - to_a * a.direction_in_world).norm() / (0.5 * (to_a + to_b));
}

WorldRay between(const WorldRay& a, const WorldRay& b, double share) {
  return {(1.0 - share) * a.origin_in_world + share * b.origin_in_world,
          ((1.0 - share) * a.direction_in_world + share * b.direction_in_world).normalized()};
}

struct Misses {
  std::vector<double> t_s, as_given, exchanged;
};

/// Misses of each row with the other head's ray at its time, if that head has rows shortly before and after.
Misses misses_of(const std::vector<TwoRays>& rows) {
  constexpr double near_s = 0.3;
  Misses misses;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const TwoRays &row = rows[i], *before = nullptr, *after = nullptr;
    for (std::size_t k = i; k-- > 0 && !before && row.t_s - rows[k].t_s < near_s;)
      if (rows[k].is_second != row.is_second) before = &rows[k];
    for (std::size_t k = i + 1; k < rows.size() && !after && rows[k].t_s - row.t_s < near_s; ++k)
      if (rows[k].is_second != row.is_second) after = &rows[k];
    if (!before || !after || !(after->t_s > before->t_s)) continue;
    const double share = (row.t_s - before->t_s) / (after->t_s - before->t_s);
    misses.t_s.push_back(row.t_s);
    misses.as_given.push_back(miss_rad(row.own, between(before->own, after->own, share)));
    misses.exchanged.push_back(miss_rad(row.other, between(before->other, after->other, share)));
  }
  return misses;
}

struct Stretch {
  double from_s = 0.0, until_s = 0.0;
  bool is_found = false;
};

/// The time span in which nearly all rows agree after exchange, and do not as given.
Stretch exchanged_stretch(const Misses& misses) {
  constexpr double clearly = 8.0, least_rad = 1e-3, nearly_all = 0.8;
  constexpr std::size_t least = 8;
  Stretch stretch;
  if (misses.t_s.size() < 4 * least) return stretch;
  const double limit_rad = std::max(least_rad, clearly * median_of(misses.as_given));
  double sum = 0.0, most = 0.0;
  std::size_t from = 0, first = 0, last = 0;
  for (std::size_t i = 0; i < misses.t_s.size(); ++i) {
    sum += (misses.exchanged[i] < limit_rad ? 1.0 : 0.0) - (misses.as_given[i] < limit_rad ? 1.0 : 0.0);
    if (sum > most) most = sum, first = from, last = i + 1;
    if (sum <= 0.0) sum = 0.0, from = i + 1;
  }
  const auto num = static_cast<double>(last - first);
  if (last < first + least || most < nearly_all * num || 2 * (last - first) > misses.t_s.size()) return stretch;
  return {misses.t_s[first], misses.t_s[last - 1], true};
}

}  // namespace

std::optional<Explanation> exchanged_rows(std::span<const TargetObservation> observations,
                                          std::span<const RigHead> heads, const FollowConfig& config) {
  constexpr double min_gain = 30.0;
  for (std::size_t a = 0; a < heads.size(); ++a) {
    for (std::size_t b = a + 1; b < heads.size(); ++b) {
      const Stretch stretch = exchanged_stretch(misses_of(two_rays(observations, heads, a, b)));
      if (!stretch.is_found) continue;
      std::vector<TargetObservation> undone(observations.begin(), observations.end());
      for (TargetObservation& one : undone)
        if ((one.head == a || one.head == b) && one.t_capture_s >= stretch.from_s && one.t_capture_s <= stretch.until_s)
          one.head = one.head == a ? b : a;
      const Trial as_that = tried(undone, heads, config);
      if (!as_that.fits || !(as_that.ln_p > tried(observations, heads, config).ln_p + min_gain)) continue;
      const std::string two = std::to_string(heads[a].head.id) + " and " + std::to_string(heads[b].head.id);
      const std::string when = text_of(stretch.from_s, 5) + " to " + text_of(stretch.until_s, 5) + " s";
      return Explanation{
          "the numbers of heads " + two + " are exchanged from " + when + ": undone, all observations fit",
          "exchange the numbers of heads " + two + " in the rows from " + when};
    }
  }
  return std::nullopt;
}

}  // namespace alidade
