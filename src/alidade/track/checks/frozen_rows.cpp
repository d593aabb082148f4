#include "alidade/track/checks/frozen_rows.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "alidade/estimation/median.h"
#include "alidade/estimation/verdict.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/track/observation_model.h"

namespace alidade {
namespace {

enum class Of { pan, tilt, pixels };

/// Pixels or readings of one head in temporal order; for readings only the first component is used.
struct Series {
  std::vector<double> t_s;
  std::vector<Eigen::Vector2d> values;
  std::vector<bool> is_taken;  ///< Belongs to a run found before.

  [[nodiscard]] std::size_t num() const { return values.size(); }
  [[nodiscard]] bool repeats(std::size_t k) const { return values[k] == values[k - 1]; }
};

Series series_of(std::span<const TargetObservation> sorted, std::size_t head, Of of) {
  Series series;
  for (const TargetObservation& one : sorted) {
    if (one.head != head) continue;
    series.t_s.push_back(one.t_capture_s);
    series.values.push_back(of == Of::pixels ? one.px : Eigen::Vector2d(one.pan_tilt_rad[of == Of::pan ? 0 : 1], 0.0));
  }
  series.is_taken.assign(series.num(), false);
  return series;
}

/// The rows first … last − 1, each equal to the one before.
struct Run {
  std::size_t first = 0, last = 0;
  [[nodiscard]] std::size_t num() const { return last - first; }
};

Run longest_run(const Series& series) {
  Run longest;
  for (std::size_t k = 1; k < series.num(); ++k) {
    if (series.is_taken[k] || !series.repeats(k)) continue;
    Run run{k, k};
    while (run.last < series.num() && series.repeats(run.last)) ++run.last;
    if (run.num() > longest.num()) longest = run;
    k = run.last;
  }
  return longest;
}

/// Whether the value after the run differs from it by far more than consecutive rows
/// do afterwards, rounding excluded: a head or target that was at rest starts slowly.
bool jumps_behind(const Series& series, const Run& run, double step) {
  constexpr std::size_t num_behind = 4;
  constexpr double clearly = 3.0;
  if (run.last + num_behind >= series.num()) return false;
  double fastest = 0.0;
  for (std::size_t k = run.last + 1; k <= run.last + num_behind; ++k)
    fastest = std::max(fastest, (series.values[k] - series.values[k - 1]).norm());
  return (series.values[run.last] - series.values[run.last - 1]).norm() - 2.0 * step > clearly * fastest;
}

/// Whether a run of that length is expected less than once in 10⁴ logs of so many rows, if `share` of the rows repeat.
bool is_rare(double share, std::size_t num_rows, const Run& run) {
  constexpr double rare = 1e-4;
  return static_cast<double>(num_rows) * std::pow(share, static_cast<double>(run.num())) < rare;
}

/// Whether the run is not explained by the rate at which rows outside runs repeat.
bool is_beyond_chance(const Series& series, const Run& run) {
  constexpr std::size_t least = 3, least_others = 16;
  if (run.num() < least) return false;
  double others = 0.0, repeated = 0.0;
  for (std::size_t k = 1; k < series.num(); ++k) {
    if (series.is_taken[k] || (k >= run.first && k < run.last)) continue;
    others += 1.0;
    repeated += series.repeats(k) ? 1.0 : 0.0;
  }
  const double share = (repeated + 1.0) / (others + 2.0);
  return others >= static_cast<double>(least_others) && is_rare(share, series.num(), run);
}

/// The rounding step of the values, if it is not far below their changes: rounded values repeat. Otherwise 0.
double step_of(const Series& series) {
  constexpr double finer = 20.0;
  double step = 0.0;
  for (const int axis : {0, 1}) {
    std::vector<double> changes;
    for (std::size_t k = 1; k < series.num(); ++k)
      if (const double by = std::abs(series.values[k][axis] - series.values[k - 1][axis]); by > 0.0)
        changes.push_back(by);
    const double least = changes.empty() ? 0.0 : *std::ranges::min_element(changes);
    if (!changes.empty() && finer * least > median_of(changes)) step = std::max(step, least);
  }
  return step;
}

/// Mean with values limited to four medians: the median of rounded values is coarse.
double robust_mean(const std::vector<double>& sizes) {
  const double most = 4.0 * median_of(sizes);
  double sum = 0.0;
  for (const double size : sizes) sum += std::min(size, most);
  return sum / static_cast<double>(sizes.size());
}

/// σ of the noise of one component from row to row, outside runs; 0 if there is none.
/// For white noise, third differences are √(20/6) = 1.8 times as large as second ones,
/// whose σ is √6 times its own; for a motion that the rows resolve, they are smaller.
double noise_of(const Series& series, Of of) {
  constexpr double between = 1.3, normal_mean = 0.7979, rayleigh_mean = 1.2533;  // mean of |n| in 1 and 2 dimensions
  std::vector<double> second, third;
  const auto& at = series.values;
  for (std::size_t k = 3; k < at.size(); ++k) {
    if (series.is_taken[k] || series.is_taken[k - 1] || series.is_taken[k - 2]) continue;
    const Eigen::Vector2d before = at[k - 1] - 2.0 * at[k - 2] + at[k - 3], now = at[k] - 2.0 * at[k - 1] + at[k - 2];
    second.push_back(now.norm());
    third.push_back((now - before).norm());
  }
  if (second.empty()) return 0.0;
  const double mean = robust_mean(second);
  if (!(robust_mean(third) > between * mean)) return 0.0;
  return mean / std::sqrt(6.0) / (of == Of::pixels ? rayleigh_mean : normal_mean);
}

/// The largest share of rows that may repeat without being frozen: a value at rest in the centre of its rounding step,
/// with the given noise less that of rounding.
double repeats_at_rest(double noise, double step, Of of) {
  const double own = std::sqrt(std::max(0.0, noise * noise - step * step / 12.0));
  if (!(own > 0.0)) return 1.0;
  const double same = std::erf(0.5 * step / (own * std::numbers::sqrt2));
  return of == Of::pixels ? same * same : same;
}

/// A run, and whether it proves by itself that something was frozen.
struct Candidate {
  FrozenRows rows;
  bool is_certain = false;
  bool is_to_end = false, jumps_behind = false;
  double step = 0.0;  ///< Rounding step: values repeat while the quantity changes by less.
};

void add_candidates(Series series, std::size_t head, Of of, std::vector<Candidate>& all) {
  constexpr std::size_t most = 8;  // per head and kind of value
  const double step = step_of(series);
  const std::size_t before = all.size();
  for (Run run = longest_run(series); is_beyond_chance(series, run) && all.size() < before + most;
       run = longest_run(series)) {
    std::fill(series.is_taken.begin() + static_cast<std::ptrdiff_t>(run.first),
              series.is_taken.begin() + static_cast<std::ptrdiff_t>(run.last), true);
    all.push_back({.rows = {.head = head,
                            .pan = of == Of::pan,
                            .tilt = of == Of::tilt,
                            .pixels = of == Of::pixels,
                            .num = run.num(),
                            .from_s = series.t_s[run.first],
                            .until_s = series.t_s[run.last - 1]},
                   .is_to_end = run.last == series.num(),
                   .jumps_behind = jumps_behind(series, run, step),
                   .step = step});
  }
  const double share = repeats_at_rest(noise_of(series, of), step, of);
  for (std::size_t k = before; k < all.size(); ++k)
    all[k].is_certain = is_rare(share, series.num(), {0, all[k].rows.num});
}

/// How well the track without the candidate's rows predicts them.
struct Expected {
  std::size_t num = 0, off = 0;  ///< Number of rows that are predicted, and of those beyond the gate.
  std::size_t beside_off = 0;    ///< Rejected rows of the head shortly before, within and after the run.
};

/// NIS of a row with a belief that does not include it.
double nis_of(const TargetObservation& row, const RigHead& head, const Candidate& of, const Belief<6>& belief,
              const TrackerConfig& config) {
  const double own = head.head.encoder.sigma_rad, sigma_rad = own > 0.0 ? own : config.sigma_encoder_rad;
  const double step_px = of.rows.pixels ? of.step : 0.0, step_rad = of.rows.pixels ? 0.0 : of.step;
  const ObservationModel see(head, row.pan_tilt_rad, std::hypot(sigma_px_of(row, config.sigma_px), step_px),
                             std::hypot(sigma_rad, step_rad), row.lens);
  const Eigen::Vector3d position = belief.x.head<3>();
  const auto seen = see(position);
  if (!seen) return std::numeric_limits<double>::infinity();
  Eigen::Matrix2d S = seen->J_z_position * belief.P.topLeftCorner<3, 3>() * seen->J_z_position.transpose() + seen->R;
  if (config.errors.num() > 0) {
    const auto effect = rig_error_effect(config.errors.factor[row.head], see.turned, *see.camera, position,
                                         belief.x.tail<3>(), row.lens);
    if (effect) S += *effect * effect->transpose();
  }
  const Eigen::Vector2d off = row.px - seen->z;
  return squared_mahalanobis(off, S);
}

Expected expected_of(const Candidate& candidate, std::span<const TargetObservation> sorted,
                     std::span<const RigHead> heads, const TrackReport& without, const TrackerConfig& config) {
  constexpr std::size_t beside = 3;
  const double larger = std::max(1.0, without.nis_per_dof);  // noise over the stated one
  const FrozenRows& rows = candidate.rows;
  Expected expected;
  std::vector<bool> is_off;  // per row of the head, whether the track rejects it
  std::size_t first = 0, last = 0;
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    const TargetObservation& row = sorted[i];
    const TrackStep& step = without.steps[i];
    if (row.head != rows.head) continue;
    is_off.push_back(step.event == TrackEvent::gated || step.event == TrackEvent::depth);
    if (row.t_capture_s < rows.from_s) first = is_off.size();
    if (row.t_capture_s <= rows.until_s) last = is_off.size();
    if (row.t_capture_s < rows.from_s || row.t_capture_s > rows.until_s) continue;
    if (!step.has_belief || step.t_s != row.t_capture_s) continue;
    ++expected.num;
    expected.off += nis_of(row, heads[row.head], candidate, step.belief, config) < larger * config.gate ? 0 : 1;
  }
  for (std::size_t k = first - std::min(first, beside); k < std::min(last + beside, is_off.size()); ++k)
    expected.beside_off += is_off[k] ? 1 : 0;
  return expected;
}

/// Whether the track contradicts the rows: it fits all others, including those next to them (a wrong rig would be wrong
/// there as well), and the head's values jump after them (with one of two heads alone, the range is only as good as the
/// motion model). While one of two heads is excluded, the range drifts, and the track may restart.
bool contradicts(const TrackReport& without, const Candidate& candidate, const Expected& expected,
                 std::size_t num_heads) {
  constexpr std::size_t min_off = 3, max_beside_off = 1, max_restarts = 2;
  constexpr double min_share = 0.1, min_used = 0.95, max_nis = 3.0;
  const auto num_out =
      static_cast<std::size_t>(std::ranges::count(without.steps, TrackEvent::frozen, &TrackStep::event));
  if (!candidate.jumps_behind && !(candidate.is_to_end && num_heads > 2)) return false;
  return expected.off >= min_off && static_cast<double>(expected.off) > min_share * static_cast<double>(expected.num) &&
         expected.beside_off <= max_beside_off && without.num_starts > 0 && without.num_restarts <= max_restarts &&
         without.nis_per_dof<max_nis&& static_cast<double>(without.num_used)> min_used *
             static_cast<double>(without.steps.size() - num_out);
}

/// Merges overlapping rows of one head.
std::vector<FrozenRows> merged(std::vector<FrozenRows> all) {
  std::ranges::stable_sort(all, {}, [](const FrozenRows& one) { return std::pair(one.head, one.from_s); });
  std::vector<FrozenRows> result;
  for (const FrozenRows& one : all) {
    if (result.empty() || result.back().head != one.head || one.from_s > result.back().until_s) {
      result.push_back(one);
      continue;
    }
    FrozenRows& last = result.back();
    last.pan |= one.pan;
    last.tilt |= one.tilt;
    last.pixels |= one.pixels;
    last.agrees &= one.agrees;
    last.num = std::max(last.num, one.num);
    last.until_s = std::max(last.until_s, one.until_s);
  }
  return result;
}

std::vector<Candidate> candidates_of(std::span<const TargetObservation> sorted, std::size_t num_heads) {
  constexpr std::size_t min_rows = 20;
  std::vector<Candidate> candidates;
  for (std::size_t head = 0; head < num_heads; ++head)
    for (const Of of : {Of::pan, Of::tilt, Of::pixels})
      if (Series series = series_of(sorted, head, of); series.num() >= min_rows)
        add_candidates(std::move(series), head, of, candidates);
  return candidates;
}

/// Whether values are rounded more coarsely than their σ allows: then the track's errors exceed its σ.
bool is_coarse(const Candidate& candidate, std::span<const RigHead> heads, const TrackerConfig& config) {
  const double own = heads[candidate.rows.head].head.encoder.sigma_rad;
  const double sigma = candidate.rows.pixels ? config.sigma_px : own > 0.0 ? own : config.sigma_encoder_rad;
  return candidate.step > std::sqrt(12.0) * sigma;
}

std::string times_of(const FrozenRows& frozen) {
  return "from " + text_of(frozen.from_s, 5) + " to " + text_of(frozen.until_s, 5) + " s";
}

}  // namespace

std::vector<FrozenRows> frozen_rows(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                    const FollowConfig& config) {
  std::vector<TargetObservation> sorted(observations.begin(), observations.end());
  std::ranges::stable_sort(sorted, {}, &TargetObservation::t_capture_s);
  std::vector<Candidate> candidates = candidates_of(sorted, heads.size());
  if (candidates.empty()) return {};
  FollowConfig plain = config;
  plain.judge = false;
  plain.predict_s = plain.smooth_s = 0.0;
  std::vector<FrozenRows> certain, frozen;
  for (const Candidate& one : candidates) {
    frozen.push_back(one.rows);
    if (one.is_certain) certain.push_back(one.rows);
  }
  plain.kept_out = rows_of(frozen, sorted);
  plain.tracker.sigma_a_m_s2 = track_target(sorted, heads, plain).sigma_a_m_s2;
  plain.find_sigma_a = false;
  frozen.clear();
  const bool coarse =
      std::ranges::any_of(candidates, [&](const Candidate& one) { return is_coarse(one, heads, config.tracker); });
  for (Candidate& one : candidates) {
    std::vector<FrozenRows> out = certain;
    out.push_back(one.rows);
    plain.kept_out = rows_of(out, sorted);
    const TrackReport without = track_target(sorted, heads, plain);
    const Expected expected = expected_of(one, sorted, heads, without, plain.tracker);
    one.rows.agrees = 2 * expected.num >= one.rows.num && expected.off == 0;
    if (one.is_certain || (!coarse && contradicts(without, one, expected, heads.size()))) frozen.push_back(one.rows);
  }
  return merged(std::move(frozen));
}

std::vector<bool> rows_of(std::span<const FrozenRows> frozen, std::span<const TargetObservation> observations) {
  std::vector<bool> is_frozen;
  if (frozen.empty()) return is_frozen;
  for (const TargetObservation& row : observations)
    is_frozen.push_back(std::ranges::any_of(frozen, [&row](const FrozenRows& one) {
      return one.head == row.head && one.from_s <= row.t_capture_s && row.t_capture_s <= one.until_s;
    }));
  return is_frozen;
}

std::string frozen_text(const FrozenRows& frozen, std::span<const RigHead> heads) {
  const bool both = frozen.pan && frozen.tilt, angles = frozen.pan || frozen.tilt;
  const std::string what = frozen.pixels && angles ? "pixels and angles"
                           : frozen.pixels         ? "pixels"
                           : both                  ? "angles"
                           : frozen.pan            ? "pan angles"
                                                   : "tilt angles";
  const std::string why = frozen.pixels && angles ? "it, or its log, stood still"
                          : frozen.pixels         ? "its image, or the detector, stood still"
                                                  : "its encoders, or their log, stood still";
  return "the " + what + " of head " + std::to_string(heads[frozen.head].head.id) +
         " are exactly those of the row before in " + std::to_string(frozen.num) + " rows " + times_of(frozen) + ": " +
         (frozen.agrees ? "the others agree with them, but they say nothing new" : why) + "; they are kept out";
}

std::string frozen_remedy(const FrozenRows& frozen, std::span<const RigHead> heads) {
  return "find out what stood still in head " + std::to_string(heads[frozen.head].head.id) + " " + times_of(frozen) +
         ": the track is without these rows";
}

}  // namespace alidade
