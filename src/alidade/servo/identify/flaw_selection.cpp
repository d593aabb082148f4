#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "alidade/servo/identify/identify_flaws.h"

namespace alidade {
namespace {

using Eigen::Index;
struct Candidate {
  std::size_t flaw = 0;
  ServoFit fit;
  double sum2 = std::numeric_limits<double>::infinity();
};

constexpr int first_steps = 8, max_steps = 40;

/// Fits one more flaw from the two best sizes; a rate limit also from one that hardly limits: a step to a limit
/// above all rates has no effect on the residuals, and would not be undone.
Candidate begun(std::span<const ServoSample> log, const ServoFit& fit, const FlawGround& ground, std::size_t flaw) {
  const bool is_linear = is_of_the_gain(flaw) || flaw == ServoFlaw::rate_offset;
  const std::size_t max_starts = is_linear ? 1 : 2;
  const std::vector<FlawScore> scores = flaw_scores(log, fit, ground, flaw);
  Candidate best{flaw, fit};
  const auto start = [&](double size) {
    ServoFit trial = fit;
    trial.freed.push_back(flaw);
    trial.flaws.*servo_flaws[flaw] = size;
    const double sum2 = refine_flawed(log, first_steps, trial);
    if (sum2 < best.sum2) best = {flaw, trial, sum2};
  };
  for (std::size_t i = 0; i < std::min(max_starts, scores.size()); ++i) start(scores[i].size);
  if (flaw == ServoFlaw::rate_limit) start(std::ranges::max_element(scores, {}, &FlawScore::size)->size);
  return best;
}

/// Completes the fits that may be the best or its rival: a fit far behind after the first steps remains so.
void finish(std::span<const ServoSample> log, std::vector<Candidate>& candidates) {
  constexpr double far = 60.0;  // in twice the log-likelihood
  std::ranges::sort(candidates, {}, &Candidate::sum2);
  double best2 = std::numeric_limits<double>::infinity(), rows = 0.0;
  for (Candidate& each : candidates) {
    if (!std::isfinite(each.sum2) || rows * std::log(each.sum2 / best2) > far) continue;
    each.sum2 = refine_flawed(log, max_steps, each.fit);
    if (each.sum2 >= best2) continue;
    best2 = each.sum2;
    rows = effective_rows(flawed_misfit(log, each.fit));
  }
  std::ranges::sort(candidates, {}, &Candidate::sum2);
}

/// The largest rate that lasts as long as a drive takes to reach it.
double lasting_rate(std::span<const ServoSample> log) {
  constexpr double min_s = 0.15;
  double most = 0.0;
  for (std::size_t i = 0, j = 0; j < log.size(); ++j) {
    while (i + 1 < j && log[j].read_s() - log[i + 1].read_s() >= min_s) ++i;
    const double dt = log[j].read_s() - log[i].read_s();
    if (j > i && dt >= min_s) most = std::max(most, std::abs(log[j].angle_rad - log[i].angle_rad) / dt);
  }
  return most;
}

/// Head with position commands: limits of rate and acceleration together, either of which alone explains little.
/// Starts from the best points of a grid, since there is more than one minimum.
Candidate limited(std::span<const ServoSample> log, const ServoFit& fit) {
  constexpr std::size_t num_starts = 3;
  constexpr int first_limit_steps = 12;
  const double rate = lasting_rate(log), late_s = fit.params[ServoParam::tau] + fit.params[ServoParam::latency];
  std::vector<Candidate> grid;
  if (!(rate > 0.0)) return {ServoFlaw::rate_limit, fit};
  for (const double to_top_s : {0.02, 0.06, 0.15, 0.3, 0.6, 1.2})
    for (const double tau : {0.05, 0.2, 0.5, 1.0})
      for (const double late : {0.0, 0.15, 0.35, 0.6, 0.85}) {
        Candidate at{ServoFlaw::rate_limit, fit};
        at.fit.freed.insert(at.fit.freed.end(), {ServoFlaw::rate_limit, ServoFlaw::acceleration_limit});
        at.fit.flaws.max_rate_rad_s = rate;
        at.fit.flaws.max_acceleration_rad_s2 = rate / to_top_s;
        at.fit.params[ServoParam::tau] *= tau;
        at.fit.params[ServoParam::latency] = late * late_s;
        at.sum2 = flawed_misfit(log, at.fit).squaredNorm();
        grid.push_back(std::move(at));
      }
  std::ranges::sort(grid, {}, &Candidate::sum2);
  Candidate best{ServoFlaw::rate_limit, fit};
  for (std::size_t i = 0; i < num_starts; ++i) {
    grid[i].sum2 = refine_flawed(log, first_limit_steps, grid[i].fit);
    if (grid[i].sum2 < best.sum2) best = grid[i];
  }
  best.sum2 = refine_flawed(log, max_steps, best.fit);
  return best;
}

bool is_limited(const ServoFit& fit) {
  return std::ranges::any_of(fit.freed, [](std::size_t flaw) { return flaw <= ServoFlaw::acceleration_limit; });
}

/// 2 ln of the likelihood ratio to the sum of squares `sum2`, counted in rows with independent errors;
/// and the rest after Schwarz's penalty for the number of parameters and a margin for the choice.
struct Evidence {
  double size = 0.0, left = -1.0;
};
Evidence evidence_for(std::span<const ServoSample> log, double sum2, double num_params, const Candidate& candidate) {
  constexpr double margin = 12.0;
  if (!std::isfinite(candidate.sum2)) return {};
  const double rows = effective_rows(flawed_misfit(log, candidate.fit)), size = rows * std::log(sum2 / candidate.sum2);
  return {size, size - num_params * std::log(rows) - margin};
}

/// The fit, with the evidence for the flaws that it has beyond the fit before.
ServoFit taken(const ServoFit& before, ServoFit fit, double evidence) {
  for (std::size_t i = before.freed.size(); i < fit.freed.size(); ++i) fit.flaw_evidence[fit.freed[i]] = evidence;
  return fit;
}

void note_rivals(std::span<const ServoSample> log, const std::vector<Candidate>& candidates,
                 std::vector<ServoRival>& rivals) {
  constexpr double clear = 10.0;
  const Candidate& best = candidates.front();
  const double rows = effective_rows(flawed_misfit(log, best.fit));
  for (std::size_t i = 1; i < candidates.size(); ++i) {
    const double evidence = rows * std::log(candidates[i].sum2 / best.sum2);
    if (evidence < clear) rivals.push_back({best.flaw, candidates[i].flaw, evidence});
  }
}

}  // namespace

double lag_one_correlation(const Eigen::VectorXd& misfit) {
  const Index n = misfit.size();
  return misfit.head(n - 1).dot(misfit.tail(n - 1)) / std::max(misfit.squaredNorm(), 1e-300);
}

double effective_rows(const Eigen::VectorXd& misfit) {
  const Index n = misfit.size();
  const double colour =
      std::clamp(misfit.head(n - 1).dot(misfit.tail(n - 1)) / std::max(misfit.squaredNorm(), 1e-300), 0.0, 0.95);
  return static_cast<double>(n) * (1.0 - colour) / (1.0 + colour);
}

std::vector<std::size_t> indicated_flaws(std::span<const ServoSample> log, const ServoFit& fit) {
  constexpr double max_correlation = 0.3, min_sigmas = 3.5;
  const FlawGround ground = flaw_ground(log, fit);
  std::vector<std::size_t> all(ServoFlaw::resonance);
  std::iota(all.begin(), all.end(), 0);
  if (std::abs(lag_one_correlation(ground.misfit)) > max_correlation) return all;
  const double sum2 = ground.misfit.squaredNorm(), least2 = min_sigmas * min_sigmas * fit.rms_rad * fit.rms_rad;
  std::vector<std::size_t> indicated;
  for (const std::size_t flaw : all)
    if (sum2 > 0.0 && flaw_scores(log, fit, ground, flaw).front().gain2 > least2) indicated.push_back(flaw);
  return std::ranges::all_of(indicated, is_of_the_log) ? indicated : all;
}

ServoFit with_flaws(std::span<const ServoSample> log, const ServoFit& start, std::span<const std::size_t> flaws,
                    std::vector<ServoRival>& rivals) {
  const std::size_t max_freed = start.freed.size() + 3;
  constexpr double max_correlation = 0.3;
  ServoFit fit = start;
  while (fit.freed.size() < max_freed) {
    const FlawGround ground = flaw_ground(log, fit);
    const double sum2 = ground.misfit.squaredNorm();
    std::vector<Candidate> candidates;
    for (const std::size_t flaw : flaws)
      if (std::ranges::count(fit.freed, flaw) == 0 && is_of_kind(fit.kind, flaw))
        candidates.push_back(begun(log, fit, ground, flaw));
    if (candidates.empty()) break;
    finish(log, candidates);
    const Candidate& best = candidates.front();
    const Evidence single = evidence_for(log, sum2, 1.0, best);
    const bool is_better = single.left > 0.0;
    const double correlation = lag_one_correlation(flawed_misfit(log, is_better ? best.fit : fit));
    if (fit.kind == ServoKind::angle && !is_limited(fit) && fit.freed.size() + 2 <= max_freed &&
        std::abs(correlation) > max_correlation) {
      const Candidate pair = limited(log, fit);
      if (evidence_for(log, is_better ? best.sum2 : sum2, is_better ? 1.0 : 2.0, pair).left > 0.0) {
        fit = taken(fit, pair.fit, evidence_for(log, sum2, 2.0, pair).size);
        continue;
      }
    }
    if (!is_better) break;
    note_rivals(log, candidates, rivals);
    fit = taken(fit, best.fit, single.size);
  }
  return fit;
}

}  // namespace alidade
