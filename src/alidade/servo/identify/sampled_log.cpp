#include "alidade/servo/identify/sampled_log.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "alidade/servo/identify/identify_causes.h"

namespace alidade {
namespace {

/// A change of the angle: a sample was taken between two rows.
struct Change {
  double t_s = 0.0, half_s = 0.0;  ///< Midpoint between the rows, and half of their interval.
};

/// Rows that differ from the one before by more than rounding. For an encoder that is read faster than it is
/// sampled, most of the rows before them are repetitions; otherwise there are none.
std::vector<Change> held_changes(std::span<const ServoSample> log) {
  constexpr double least_steps = 2.5, least_share = 0.4;
  const double least_rad = least_steps * encoder_step_rad(log);
  const auto moves = [&](std::size_t row) { return log[row].angle_rad != log[row - 1].angle_rad; };
  std::vector<Change> changes;
  double held = 0.0;
  for (std::size_t i = 2; i < log.size(); ++i) {
    if (!moves(i) || !(std::abs(log[i].angle_rad - log[i - 1].angle_rad) > least_rad)) continue;
    changes.push_back({0.5 * (log[i - 1].t_s + log[i].t_s), 0.5 * (log[i].t_s - log[i - 1].t_s)});
    held += moves(i - 1) ? 0.0 : 1.0;
  }
  if (!(held >= least_share * static_cast<double>(changes.size()))) changes.clear();
  return changes;
}

/// Mean of exp(2πi t/P) over the changes.
std::complex<double> coherence(std::span<const Change> changes, double hz) {
  std::complex<double> sum = 0.0;
  for (const Change& change : changes)
    sum += std::polar(1.0, 2.0 * std::numbers::pi * hz * (change.t_s - changes.front().t_s));
  return sum / static_cast<double>(changes.size());
}

/// The frequency within `reach_hz` of `hz` at which the changes are most coherent.
double most_coherent(std::span<const Change> changes, double hz, double reach_hz) {
  constexpr double per_cycle = 0.1;
  const double step_hz = per_cycle / (changes.back().t_s - changes.front().t_s);
  double best_hz = hz, best = -1.0;
  for (double tried = std::max(step_hz, hz - reach_hz); tried <= hz + reach_hz; tried += step_hz) {
    const double size = std::abs(coherence(changes, tried));
    if (size > best) best = size, best_hz = tried;
  }
  return best_hz;
}

/// Initial period from consecutive changes: longer intervals contain pauses.
double first_period(std::span<const Change> changes) {
  constexpr double longest = 1.6;
  std::vector<double> apart;
  for (std::size_t i = 1; i < changes.size(); ++i) apart.push_back(changes[i].t_s - changes[i - 1].t_s);
  std::ranges::sort(apart);
  const double middle = apart[apart.size() / 2];
  double sum = 0.0, count = 0.0;
  for (const double each : apart)
    if (each <= longest * middle && longest * each >= middle) sum += each, count += 1.0;
  return sum / count;
}

/// The frequency from a few changes, then from twice as many, until all are used.
double frequency_of(std::span<const Change> changes) {
  constexpr std::size_t first = 24;
  constexpr double first_reach = 0.15;
  double hz = 1.0 / first_period(changes), reach_hz = first_reach * hz;
  for (std::size_t num = std::min(first, changes.size());; num = std::min(2 * num, changes.size())) {
    const std::span<const Change> some = changes.first(num);
    hz = most_coherent(some, hz, reach_hz);
    reach_hz = 1.5 / (some.back().t_s - some.front().t_s);
    if (num == changes.size()) return hz;
  }
}

/// Range of the phase consistent with the changes, except a share of outliers: each sample was between two rows.
struct PhaseRange {
  double low_s = 0.0, high_s = 0.0;
};
PhaseRange phase_range(std::span<const Change> changes, double period_s, double phase_s, double outliers) {
  std::vector<double> low, high;
  for (const Change& change : changes) {
    const double off = std::remainder(change.t_s - phase_s, period_s);
    low.push_back(off - change.half_s);
    high.push_back(off + change.half_s);
  }
  std::ranges::sort(low, std::greater{});
  std::ranges::sort(high);
  const auto at = static_cast<std::size_t>(outliers * static_cast<double>(changes.size()));
  return {phase_s + low[at], phase_s + high[at]};
}

/// Period and phase on successively finer grids: the period with the widest range of the phase, which refers to the
/// middle of the log.
EncoderSampling closest_sampling(std::span<const Change> changes, double period_s, double middle_s, double outliers) {
  constexpr int half = 20, rounds = 3;
  const double cycles = 0.5 * (changes.back().t_s - changes.front().t_s) / period_s;
  const auto phase_at = [&](double period) {
    std::complex<double> sum = 0.0;
    for (const Change& change : changes)
      sum += std::polar(1.0, 2.0 * std::numbers::pi * (change.t_s - middle_s) / period);
    return middle_s + period * std::arg(sum) / (2.0 * std::numbers::pi);
  };
  double reach_s = 0.2 * period_s, best_s = period_s;
  for (int round = 0; round < rounds; ++round, reach_s *= 4.0 / half) {
    double most = -1e300, sum = 0.0, count = 0.0;
    for (int i = -half; i <= half; ++i) {
      const double tried = best_s + reach_s * i / (half * cycles);
      const PhaseRange range = phase_range(changes, tried, phase_at(tried), outliers);
      const double left = range.high_s - range.low_s;
      if (left > most + 1e-9) most = left, sum = 0.0, count = 0.0;
      if (left >= most - 1e-9) sum += tried, count += 1.0;
    }
    best_s = sum / count;
  }
  return {best_s, phase_at(best_s)};
}

}  // namespace

bool is_reading(std::span<const ServoSample> log, std::size_t row) {
  return row == 0 || log[row].read_s() > log[row - 1].read_s();
}

std::vector<double> reading_times(std::span<const ServoSample> log) {
  std::vector<double> times_s;
  times_s.reserve(log.size());
  for (std::size_t i = 0; i < log.size(); ++i)
    if (is_reading(log, i)) times_s.push_back(log[i].read_s());
  return times_s;
}

Eigen::VectorXd readings_of(std::span<const ServoSample> log) {
  std::vector<double> angles;
  angles.reserve(log.size());
  for (std::size_t i = 0; i < log.size(); ++i)
    if (is_reading(log, i)) angles.push_back(log[i].angle_rad);
  return Eigen::Map<const Eigen::VectorXd>(angles.data(), static_cast<Eigen::Index>(angles.size()));
}

std::optional<HeldSampling> held_sampling(std::span<const ServoSample> log) {
  constexpr std::size_t least = 30;
  constexpr double least_coherence = 0.5;
  const std::vector<Change> changes = held_changes(log);
  if (changes.size() < least) return std::nullopt;
  const double hz = frequency_of(changes), spacing_s = 2.0 * changes[changes.size() / 2].half_s;
  if (!(std::abs(coherence(changes, hz)) > least_coherence) || !(1.0 / hz > 1.5 * spacing_s)) return std::nullopt;
  const double middle_s = 0.5 * (log.front().t_s + log.back().t_s);
  for (const double outliers : {0.0, 0.02}) {  // share, for a sampling that is not quite regular
    const EncoderSampling sampling = closest_sampling(changes, 1.0 / hz, middle_s, outliers);
    const PhaseRange range = phase_range(changes, sampling.period_s, sampling.phase_s, outliers);
    if (range.high_s < range.low_s && outliers == 0.0) continue;
    return HeldSampling{{sampling.period_s, 0.5 * (range.low_s + range.high_s)},
                        std::abs(range.high_s - range.low_s) / std::sqrt(12.0)};
  }
  return std::nullopt;
}

std::vector<double> sampled_times(std::span<const ServoSample> log, const EncoderSampling& sampling) {
  std::vector<double> cycles;
  for (std::size_t i = 0; i < log.size(); ++i) {
    cycles.push_back(sampling.cycle(log[i].t_s));
    if (i == 0 || log[i].angle_rad == log[i - 1].angle_rad) continue;
    // A change shows the sample that was taken between the two rows; the row before has an earlier one.
    const double sample = std::round((0.5 * (log[i - 1].t_s + log[i].t_s) - sampling.phase_s) / sampling.period_s);
    if (std::abs(cycles[i] - sample) <= 1.0) cycles[i] = std::max(cycles[i], sample);
    if (std::abs(cycles[i - 1] - sample) <= 1.0) cycles[i - 1] = std::min(cycles[i - 1], cycles[i] - 1.0);
  }
  std::vector<double> times_s;
  double last = -1e300;
  for (const double cycle : cycles) {
    last = std::max(last, cycle);
    times_s.push_back(sampling.phase_s + (last + 0.5) * sampling.period_s);
  }
  return times_s;
}

std::vector<ServoSample> sampled_log(std::span<const ServoSample> log, const std::vector<double>& sampled_t_s,
                                     const std::vector<double>& command_t_s) {
  std::vector<ServoSample> rows(log.begin(), log.end());
  for (std::size_t i = 0; i < command_t_s.size(); ++i) rows[i].command_t_s = command_t_s[i];
  for (std::size_t i = 0; i < rows.size(); ++i)
    rows[i].sampled_t_s = sampled_t_s.empty() ? std::nan("") : sampled_t_s[i];
  return rows;
}

std::vector<double> by_row(std::span<const ServoSample> log, const std::vector<double>& by_reading) {
  std::vector<double> values;
  std::size_t next = 0;
  for (std::size_t i = 0; i < log.size(); ++i) {
    if (is_reading(log, i)) ++next;
    values.push_back(by_reading[next - 1]);
  }
  return values;
}

}  // namespace alidade
