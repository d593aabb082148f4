#include "alidade/servo/identify/identify_flaws.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>
#include <vector>

#include "alidade/estimation/median.h"
#include "alidade/pantilt/positioner.h"
#include "alidade/servo/identify/identify_clusters.h"
#include "alidade/servo/identify/sampled_log.h"

namespace alidade {
namespace {

using Eigen::Index;

/// Frequencies that the readings resolve: from two cycles per log to two and a half readings per cycle.
std::vector<double> frequencies(std::span<const ServoSample> log, double ratio) {
  constexpr double lowest_hz = 0.5, highest_hz = 50.0, per_log = 2.0, per_reading = 0.4;
  const std::vector<double> times_s = reading_times(log);
  const double duration_s = times_s.back() - times_s.front();
  const double most = std::min(highest_hz, per_reading * static_cast<double>(times_s.size() - 1) / duration_s);
  std::vector<double> all;
  for (double hz = std::max(lowest_hz, per_log / duration_s); hz < most; hz *= ratio) all.push_back(hz);
  return all;
}

/// Contribution of a resonance with a share of one to a response, which is taken as linear between readings.
Eigen::VectorXd added_by(const std::vector<double>& times_s, const Eigen::VectorXd& response, double hz,
                         double damping) {
  Eigen::VectorXd added = Eigen::VectorXd::Zero(response.size());
  std::optional<Resonance> swinging;
  for (Index i = 1; i < response.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const double dt_s = times_s[at] - times_s[at - 1];
    const double rate = dt_s > 0.0 ? (response[i] - response[i - 1]) / dt_s : 0.0;
    if (!swinging) swinging.emplace(Mode{hz, damping, 1.0}, DriveMotion{response[i - 1], rate});
    swinging->advance(dt_s, {response[i - 1], rate}, {response[i], rate});
    added[i] = swinging->angle_rad() - response[i];
  }
  return added;
}

/// The same with the parameters projected out; none if these can reproduce nearly all of it.
std::optional<Eigen::VectorXd> added_across(const std::vector<double>& times_s, const FlawGround& ground, double rms,
                                            double hz, double damping) {
  constexpr double least = 1e-3;
  Eigen::VectorXd added = added_by(times_s, ground.response, hz, damping);
  added -= ground.across * (ground.across.transpose() * added);
  if (!(added.squaredNorm() > least * rms * rms)) return std::nullopt;
  return added;
}

double at_lag(const Eigen::VectorXd& values, Index lag) {
  return values.head(values.size() - lag).dot(values.tail(values.size() - lag));
}

/// Variance of Σ own · error for errors correlated like `left`; at least that for white
/// errors, and that for errors which grow with the motion of the axis, like errors of
/// times (H. White, "A heteroskedasticity-consistent covariance matrix estimator", 1980).
double score_variance(const Eigen::VectorXd& own, const Eigen::VectorXd& left, double dof) {
  constexpr std::size_t least_lags = 4, parts = 8;
  const std::vector<double> errors(left.data(), left.data() + left.size());
  const std::size_t most = std::max(least_lags, errors.size() / parts);
  const auto lags = static_cast<Index>(std::clamp(2 * correlated_rows(errors), least_lags, most));
  const double white = left.squaredNorm() / dof * own.squaredNorm();
  double sum = white;
  for (Index lag = 1; lag <= lags; ++lag) {
    const double window = 1.0 - static_cast<double>(lag) / static_cast<double>(lags + 1);
    sum += 2.0 * window * at_lag(left, lag) / dof * at_lag(own, lag);
  }
  return std::max({sum, white, own.cwiseProduct(left).squaredNorm()});
}

/// The log with commands at lost rows assumed between their neighbours: each one after a gap is then treated as
/// if it was given in the middle of the gap.
std::vector<ServoSample> with_lost_rows(std::span<const ServoSample> log) {
  constexpr double least = 1.5;
  std::vector<double> apart_s;
  for (std::size_t i = 1; i < log.size(); ++i) apart_s.push_back(log[i].t_s - log[i - 1].t_s);
  const double spacing_s = median_of(apart_s);
  std::vector<ServoSample> rows(log.begin(), log.end());
  for (std::size_t i = 1; i < log.size(); ++i)
    if (apart_s[i - 1] > least * spacing_s && std::isnan(log[i].command_t_s))
      rows[i].command_t_s = log[i].t_s - 0.5 * (apart_s[i - 1] - spacing_s);
  return rows;
}

/// Extends the ground by one more direction that the parameters can follow: the change to `response`.
void let_follow(const Eigen::VectorXd& response, FlawGround& ground) {
  constexpr double least = 1e-6;
  Eigen::VectorXd added = response - ground.response;
  const double size = added.norm();
  added -= ground.across * (ground.across.transpose() * added);
  if (!(added.norm() > least * size)) return;
  ground.across.conservativeResize(Eigen::NoChange, ground.across.cols() + 1);
  ground.across.rightCols<1>() = added.normalized();
}

struct ResonantFit {
  ServoFit fit;
  double sum2 = 0.0;
};

/// Fits with a resonance at the best frequencies of a grid for each of several damping ratios, with the share from
/// one linearisation, and their residuals. Best first, without neighbours of better ones.
std::vector<ResonantFit> starts_at(std::span<const ServoSample> log, const ServoFit& base) {
  constexpr double ratio = 1.15, most_share = 2.0, apart = 1.5;
  constexpr std::size_t most = 2;
  const std::vector<double> times_s = reading_times(log);
  FlawGround ground = flaw_ground(log, base);
  ground.misfit -= ground.across * (ground.across.transpose() * ground.misfit);
  ServoFit start = base;
  start.freed.insert(start.freed.end(),
                     {ServoFlaw::resonance, ServoFlaw::resonance_damping, ServoFlaw::resonance_share});
  std::vector<ResonantFit> grid, starts;
  for (const double hz : frequencies(log, ratio))
    for (const double damping : {0.05, 0.25, 0.7}) {
      const auto own = added_across(times_s, ground, base.rms_rad, hz, damping);
      if (!own) continue;
      const double share = std::clamp(-own->dot(ground.misfit) / own->squaredNorm(), -most_share, most_share);
      start.flaws.resonance_hz = hz;
      start.flaws.resonance_damping = damping;
      start.flaws.resonance_share = share;
      grid.push_back({start, (ground.misfit + share * *own).squaredNorm()});
    }
  std::ranges::sort(grid, {}, &ResonantFit::sum2);
  for (const ResonantFit& at : grid) {
    const bool is_near = std::ranges::any_of(starts, [&](const ResonantFit& other) {
      return std::abs(std::log(other.fit.flaws.resonance_hz / at.fit.flaws.resonance_hz)) < std::log(apart);
    });
    if (!is_near && starts.size() < most) starts.push_back(at);
  }
  return starts;
}

/// Whether a resonance is plausible: lightly damped within the resolved range, or a second-order axis (share of 1).
bool has_meaning(std::span<const ServoSample> log, const ServoFlaws& flaws) {
  constexpr double most_damping = 0.6, beyond = 1.2;  // above 0.7 there is no resonance
  constexpr double off_whole = 0.1, most_of_an_axis = 0.97;
  const bool is_whole = std::abs(flaws.resonance_share - 1.0) < off_whole && flaws.resonance_damping < most_of_an_axis;
  const std::vector<double> known = frequencies(log, beyond);
  return !known.empty() && (flaws.resonance_damping < most_damping || is_whole) &&
         flaws.resonance_hz > known.front() / beyond && flaws.resonance_hz < known.back() * beyond * beyond;
}

/// Removes trials that have converged to the same solution as a better one, and those whose 2 ln of the likelihood is
/// `far` below the best.
void leave_out_followers(double rows, double far, std::vector<ResonantFit>& trials) {
  constexpr double same = 0.01;
  std::vector<ResonantFit> kept;
  for (const ResonantFit& trial : trials) {
    const bool is_there = std::ranges::any_of(kept, [&](const ResonantFit& better) {
      return std::abs(better.fit.flaws.resonance_hz / trial.fit.flaws.resonance_hz - 1.0) < same &&
             std::abs(better.fit.flaws.resonance_share - trial.fit.flaws.resonance_share) < same;
    });
    if (!is_there && (kept.empty() || rows * std::log(trial.sum2 / trials.front().sum2) < far)) kept.push_back(trial);
  }
  trials = std::move(kept);
}

/// −2 ln of a fit's evidence: the likelihood marginalised over its parameters (Laplace), so
/// that a narrow minimum due to noise does not win over a wide one. The prior of frequency
/// and damping has a σ of a factor of e. `rows`: number of rows with independent errors.
double improbability(std::span<const ServoSample> log, const ResonantFit& trial, double rows) {
  const ServoFit& fit = trial.fit;
  Eigen::MatrixXd J = flawed_jacobian(log, fit);
  Eigen::VectorXd usual = Eigen::VectorXd::Zero(J.cols());
  for (std::size_t i = 0; i < fit.freed.size(); ++i) {
    if (fit.freed[i] != ServoFlaw::resonance && fit.freed[i] != ServoFlaw::resonance_damping) continue;
    const Index at = num_servo_params + static_cast<Index>(i);
    J.col(at) *= fit.flaws.*servo_flaws[fit.freed[i]];
    usual[at] = 1.0;
  }
  Eigen::MatrixXd A = J.transpose() * J * (rows / trial.sum2);
  A.diagonal() += usual;
  return rows * std::log(trial.sum2) + log_determinant(A);
}

/// Other flaws that the residuals indicate and the fit does not have, each with the size that explains most.
std::vector<ServoFlaws> other_causes(std::span<const ServoSample> log, const ServoFit& fit, const FlawGround& ground) {
  constexpr double min_sigmas = 3.5;
  std::vector<ServoFlaws> others;
  for (std::size_t flaw = 0; flaw < ServoFlaw::resonance; ++flaw) {
    if (std::ranges::count(fit.freed, flaw) > 0) continue;
    const FlawScore best = flaw_scores(log, fit, ground, flaw).front();
    if (!(best.gain2 > min_sigmas * min_sigmas * fit.rms_rad * fit.rms_rad)) continue;
    others.push_back(fit.flaws);
    others.back().*servo_flaws[flaw] = best.size;
  }
  return others;
}

}  // namespace

AddedResonances added_resonances(std::span<const ServoSample> log, const Eigen::VectorXd& response, double damping) {
  constexpr double ratio = 1.15;
  const std::vector<double> times_s = reading_times(log);
  AddedResonances all{frequencies(log, ratio), {}};
  all.added.resize(response.size(), static_cast<Index>(all.hz.size()));
  for (std::size_t i = 0; i < all.hz.size(); ++i)
    all.added.col(static_cast<Index>(i)) = added_by(times_s, response, all.hz[i], damping);
  return all;
}

ResonanceScore resonance_score(std::span<const ServoSample> log, const ServoFit& fit, FlawGround ground,
                               std::span<const ServoFlaws> others) {
  constexpr double ratio = 1.06;
  let_follow(flawed_response(with_lost_rows(log), fit, fit.flaws), ground);  // for a chirp it looks like a resonance
  for (const ServoFlaws& other : others) let_follow(flawed_response(log, fit, other), ground);
  ground.misfit -= ground.across * (ground.across.transpose() * ground.misfit);
  const double num = static_cast<double>(ground.across.cols()) + 1.0;
  const double dof = std::max(1.0, static_cast<double>(ground.misfit.size()) - num);
  const double sum2 = ground.misfit.squaredNorm();
  const std::vector<double> times_s = reading_times(log);
  ResonanceScore best;
  if (!(sum2 > 0.0)) return best;
  for (const double hz : frequencies(log, ratio))
    for (const double damping : {0.02, 0.07, 0.25}) {
      const auto own = added_across(times_s, ground, fit.rms_rad, hz, damping);
      if (!own) continue;
      const double own2 = own->squaredNorm(), along = -own->dot(ground.misfit), share = along / own2;
      const double white2 = std::max(sum2 - share * along, 1e-12 * sum2) / dof * own2;
      if (along * along <= best.sigmas * best.sigmas * white2) continue;  // correlated errors reduce the score
      const double sigmas = std::abs(along) / std::sqrt(score_variance(*own, ground.misfit + share * *own, dof));
      if (sigmas > best.sigmas) best = {hz, damping, share, sigmas};
    }
  return best;
}

bool asks_for_resonance(std::span<const ServoSample> log, const ServoFit& fit) {
  const FlawGround ground = flaw_ground(log, fit);
  return resonance_score(log, fit, ground).sigmas > sigmas_of_a_resonance &&
         resonance_score(log, fit, ground, other_causes(log, fit, ground)).sigmas > sigmas_of_a_resonance;
}

std::optional<ServoFit> with_resonance(std::span<const ServoSample> log, const ServoFit& fit) {
  std::vector<ResonantFit> trials;
  for (const double tau : {1.0, 0.4})
    for (const double late : {1.0, 0.3}) {
      ServoFit base = fit;
      base.params[ServoParam::tau] *= tau;
      base.params[ServoParam::latency] *= late;
      std::ranges::copy(starts_at(log, base), std::back_inserter(trials));
    }
  // A few steps for all, more for the better ones, and full convergence for those that may be the best.
  struct Round {
    std::size_t most;
    int max_steps;
    double far;
  };
  constexpr std::array<Round, 3> rounds{{{8, 4, 1e9}, {3, 8, 30.0}, {3, 40, 30.0}}};
  double rows = 0.0;
  for (const auto& [most, max_steps, far] : rounds) {
    trials.resize(std::min(most, trials.size()));
    for (ResonantFit& trial : trials) trial.sum2 = refine_flawed(log, max_steps, trial.fit);
    std::ranges::sort(trials, {}, &ResonantFit::sum2);
    if (trials.empty()) return std::nullopt;
    rows = effective_rows(flawed_misfit(log, trials.front().fit));
    leave_out_followers(rows, far, trials);
  }
  std::ranges::sort(trials, {}, [&](const ResonantFit& trial) { return improbability(log, trial, rows); });
  ServoFit& best = trials.front().fit;
  if (!has_meaning(log, best.flaws)) return std::nullopt;
  for (std::size_t flaw = ServoFlaw::resonance; flaw < num_servo_flaws; ++flaw)
    best.flaw_evidence[flaw] =
        rows * std::log(flawed_misfit(log, fit).squaredNorm() / std::max(trials.front().sum2, 1e-300));
  return best;
}

}  // namespace alidade
