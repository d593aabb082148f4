#include "alidade/track/checks/other_object.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "alidade/estimation/median.h"
#include "alidade/estimation/verdict.h"
#include "alidade/track/checks/rig_faults.h"

namespace alidade {
namespace {

/// The rays of a head in temporal order.
struct Rays {
  std::vector<double> t_s;
  std::vector<Eigen::Vector3d> directions;
};

Rays rays_of(std::span<const TargetObservation> observations, const RigHead& rig_head, std::size_t head) {
  std::vector<std::pair<double, Eigen::Vector3d>> rays;
  for (const TargetObservation& observation : observations) {
    if (observation.head != head) continue;
    if (const auto ray = ray_in_world(rig_head, observation))
      rays.emplace_back(observation.t_capture_s, ray->direction_in_world);
  }
  std::ranges::stable_sort(rays, {}, &std::pair<double, Eigen::Vector3d>::first);
  Rays result;
  for (const auto& [t_s, direction] : rays) {
    result.t_s.push_back(t_s);
    result.directions.push_back(direction);
  }
  return result;
}

/// A change of the ray from one row to the next, beyond the rate of the rows around it.
struct Jump {
  std::size_t row = 0;  ///< The row after the jump.
  Eigen::Vector3d by = Eigen::Vector3d::Zero();
};

Eigen::Vector3d rate_around(const Rays& rays, std::size_t row) {
  constexpr std::size_t reach = 4;
  const std::size_t first = row > reach ? row - reach : 1, last = std::min(row + reach, rays.t_s.size());
  Eigen::Vector3d rate;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> rates;
    for (std::size_t k = first; k < last; ++k)
      rates.push_back((rays.directions[k][axis] - rays.directions[k - 1][axis]) /
                      std::max(rays.t_s[k] - rays.t_s[k - 1], 1e-6));
    rate[axis] = median_of(std::move(rates));
  }
  return rate;
}

/// The largest jumps, in temporal order: above 8σ of the changes of all rows.
std::vector<Jump> jumps_of(const Rays& rays) {
  constexpr double min_sigma = 8.0, max_apart_s = 3.0;
  constexpr std::size_t most = 6;
  std::vector<Jump> all;
  std::vector<double> sizes;
  for (std::size_t k = 1; k < rays.t_s.size(); ++k) {
    const double dt_s = rays.t_s[k] - rays.t_s[k - 1];
    if (!(dt_s < max_apart_s)) continue;
    all.push_back({k, rays.directions[k] - rays.directions[k - 1] - dt_s * rate_around(rays, k)});
    sizes.push_back(all.back().by.norm());
  }
  const double limit = min_sigma * median_of(sizes) / rayleigh_median;
  std::erase_if(all, [limit](const Jump& jump) { return !(jump.by.norm() > limit); });
  std::ranges::stable_sort(all, std::ranges::greater{}, [](const Jump& jump) { return jump.by.norm(); });
  all.resize(std::min(all.size(), most));
  std::ranges::sort(all, {}, &Jump::row);
  return all;
}

/// Rows from one jump to another, or to an end of the log: at most half of the head's rows, largest
/// jumps first.
std::vector<OtherObject> candidates_of(const Rays& rays, std::size_t head) {
  constexpr std::size_t min_rows = 4;
  const std::vector<Jump> jumps = jumps_of(rays);
  std::vector<std::pair<double, OtherObject>> found;
  const auto add = [&](std::size_t first, std::size_t last, double size, double largest) {
    if (last < first + min_rows || 2 * (last - first) > rays.t_s.size()) return;
    found.emplace_back(size, OtherObject{.head = head,
                                         .num = last - first,
                                         .from_s = rays.t_s[first],
                                         .until_s = rays.t_s[last - 1],
                                         .is_to_an_end = first == 0 || last == rays.t_s.size(),
                                         .jump_rad = largest});
  };
  for (std::size_t i = 0; i < jumps.size(); ++i) {
    const double size = jumps[i].by.norm();
    add(jumps[i].row, rays.t_s.size(), size, size);
    add(0, jumps[i].row, size, size);
    for (std::size_t j = i + 1; j < jumps.size(); ++j) {
      const double other = jumps[j].by.norm();
      add(jumps[i].row, jumps[j].row, size + other, std::max(size, other));
    }
  }
  std::ranges::stable_sort(found, std::ranges::greater{}, &std::pair<double, OtherObject>::first);
  std::vector<OtherObject> candidates;
  for (const auto& each : found) candidates.push_back(each.second);
  return candidates;
}

/// The rows around the candidate's without these, and their indices among all rows.
struct Others {
  std::vector<TargetObservation> rows;
  std::vector<std::size_t> places;
};

Others others_of(std::span<const TargetObservation> observations, const OtherObject& other) {
  constexpr std::size_t most_around = 1500, most_within = 4000;  // enough to decide
  const auto is_of_it = [&](const TargetObservation& one) {
    return one.head == other.head && one.t_capture_s >= other.from_s && one.t_capture_s <= other.until_s;
  };
  std::size_t first = observations.size(), last = 0;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    if (!is_of_it(observations[i])) continue;
    first = std::min(first, i);
    last = i;
  }
  Others others;
  if (first > last || last - first > most_within) return others;
  for (std::size_t i = first - std::min(first, most_around); i < std::min(observations.size(), last + most_around);
       ++i) {
    if (is_of_it(observations[i])) continue;
    others.rows.push_back(observations[i]);
    others.places.push_back(i);
  }
  return others;
}

/// Whether a track may be good. While one of two heads is excluded, the range drifts, and the track may restart once.
bool may_be_good(const TrackReport& report) {
  constexpr double min_used = 0.95, max_nis = 1.3;
  return report.num_starts > 0 && report.num_restarts <= 1 &&
         report.nis_per_dof<max_nis&& static_cast<double>(report.num_used)> min_used *
             static_cast<double>(report.steps.size()) &&
         alike_per_head(report).empty();
}

/// Whether the track without those rows fits; determines how far the track with them is off there.
bool fits_without(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                  const FollowConfig& config, const TrackReport& report, OtherObject& other) {
  const Others others = others_of(observations, other);
  FollowConfig plain = config;
  plain.predict_s = plain.smooth_s = 0.0;
  const TrackReport without = track_target(others.rows, heads, plain);
  if (!may_be_good(without)) return false;
  for (std::size_t k = 0; k < without.steps.size(); ++k) {
    const TrackStep &now = report.steps[others.places[k]], &right = without.steps[k];
    if (!now.has_belief || !right.has_belief || now.t_s < other.from_s || now.t_s > other.until_s) continue;
    const Eigen::Vector3d by = (now.belief.x - right.belief.x).head<3>();
    const Eigen::Vector3d sigma = now.belief.P.diagonal().head<3>().array().sqrt();
    other.moved_in_sigma = std::max(other.moved_in_sigma, (by.array().abs() / sigma.array()).maxCoeff());
  }
  return true;
}

std::string rows_text(const OtherObject& other, std::span<const RigHead> heads) {
  return "head " + std::to_string(heads[other.head].head.id) + " from " + text_of(other.from_s, 5) + " to " +
         text_of(other.until_s, 5) + " s";
}

}  // namespace

std::optional<OtherObject> other_object(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                        const FollowConfig& config, const TrackReport& report) {
  constexpr std::size_t most = 4;  // per head
  std::optional<OtherObject> fewest;
  for (std::size_t head = 0; head < heads.size(); ++head) {
    std::vector<OtherObject> candidates = candidates_of(rays_of(observations, heads[head], head), head);
    for (std::size_t k = 0; k < std::min(most, candidates.size()); ++k)
      if ((!fewest || candidates[k].num < fewest->num) &&
          fits_without(observations, heads, config, report, candidates[k]))
        fewest = candidates[k];
  }
  return fewest;
}

std::string other_object_text(const OtherObject& other, std::span<const RigHead> heads) {
  return "the " + std::to_string(other.num) + " rows of " + rows_text(other, heads) + " are of another object" +
         (other.is_to_an_end ? ", or the head itself was turned" : "") + ": its ray jumps there by " +
         text_of(other.jump_rad * 180.0 / std::numbers::pi, 2) +
         "°, and without them the others fit, which they do not with them" +
         (other.moved_in_sigma > 1.0 ? " (the track is up to " + text_of(other.moved_in_sigma, 2) + "σ off there)"
                                     : "");
}

std::string other_object_remedy(const OtherObject& other, std::span<const RigHead> heads) {
  return "leave out the rows of " + rows_text(other, heads);
}

}  // namespace alidade
