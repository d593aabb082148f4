#include "alidade/servo/identify/identify.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <tuple>

#include "alidade/geometry/decompositions.h"
#include "alidade/servo/identify/frequent_commands.h"
#include "alidade/servo/identify/identify_causes.h"
#include "alidade/servo/identify/identify_clusters.h"
#include "alidade/servo/identify/identify_flaws.h"
#include "alidade/servo/identify/log_times.h"
#include "alidade/servo/identify/sampled_log.h"

namespace alidade {
namespace {

/// Cluster-robust covariance from blocks of rows, in scaled parameters so that units do not matter.
void set_clusters(std::span<const ServoSample> log, const Eigen::MatrixXd& J, ServoIdentification& result) {
  ServoFit& fit = result.fit;
  result.correlated_rows = correlated_rows(result.residual_rad);
  const auto inverse = inverse_normal(J);
  fit.is_observable = inverse.has_value();
  if (!fit.is_observable || !(fit.rms_rad > 0.0)) return;
  const Eigen::VectorXd scale = inverse->diagonal().cwiseSqrt().cwiseMax(1e-300), down = scale.cwiseInverse();
  result.clusters =
      servo_clusters(result.residual_rad, J * scale.asDiagonal(), down.asDiagonal() * *inverse * down.asDiagonal());
  const Eigen::MatrixXd cov = scale.asDiagonal() * result.clusters.cov * scale.asDiagonal();
  fit.cov_model = fit.rms_rad * fit.rms_rad * inverse->topLeftCorner<num_servo_params, num_servo_params>();
  fit.cov = cov.topLeftCorner<num_servo_params, num_servo_params>();
  for (std::size_t i = 0; i < fit.freed.size(); ++i) {
    const Eigen::Index at = num_servo_params + static_cast<Eigen::Index>(i);
    fit.flaw_sigma[fit.freed[i]] = std::sqrt(cov(at, at));
  }
  for (std::size_t i = 0; i < result.slips.size(); ++i) {
    const auto at = num_servo_params + static_cast<Eigen::Index>(fit.freed.size() + i);
    result.slips[i].sigma_rad = std::sqrt(cov(at, at));
  }
  count_short_lag(log, fit);
  count_ordinary_flaws(log, J, *inverse, result);
  count_time_stamps(log, J, *inverse, result);
}

/// Index of the selected one of two fits, angle and rate.
std::size_t believed_of(const std::array<ServoFit, 2>& fits, ServoKindRule rule) {
  // An angle plant with a very long lag looks like a rate plant: a tenth less is not due to chance.
  if (rule == ServoKindRule::automatic) return fits[1].rms_rad < 0.9 * fits[0].rms_rad ? 1 : 0;
  return rule == ServoKindRule::rate ? 1 : 0;
}

/// Converts statistics of readings to rows, and adds the latency that the sampling phase leaves open.
void count_by_row(std::span<const ServoSample> log, double sigma_phase_s, ServoIdentification& result) {
  const auto readings = static_cast<double>(result.residual_rad.size()), rows = static_cast<double>(log.size());
  result.correlated_rows =
      static_cast<std::size_t>(std::ceil(static_cast<double>(result.correlated_rows) * rows / readings));
  result.residual_rad = by_row(log, result.residual_rad);
  result.fit.cov(ServoParam::latency, ServoParam::latency) += sigma_phase_s * sigma_phase_s;
}

ServoIdentification::Status status_of(const ServoFit& fit) {
  if (!fit.is_observable) return ServoIdentification::Status::degenerate;
  return fit.has_converged ? ServoIdentification::Status::converged : ServoIdentification::Status::not_converged;
}

/// Fits for both kinds of plant, with everything else found in the log.
struct Solution {
  std::vector<ServoSample> log;  ///< The log with the times of the commands.
  std::array<ServoFit, 2> fits;
  std::array<std::vector<ServoRival>, 2> rivals;
  std::size_t believed = 0;
  std::optional<CommandTimes> times;
  std::vector<std::size_t> lost_commands;
  std::vector<ZeroSlip> slips;

  [[nodiscard]] const ServoFit& fit() const { return fits[believed]; }
  [[nodiscard]] bool is_plain() const { return fit().freed.empty() && slips.empty() && lost_commands.empty(); }
};

/// A gain that differs by the sign of the command makes a rate plant drift, which may hide everything else in a search
/// without it: if structure is left, searches with it, and keeps that fit with flaws if it leaves clearly less.
void try_gain_by_sign(std::span<const ServoSample> log, std::span<const std::size_t> flaws, ServoFit& fit,
                      std::vector<ServoRival>& rivals) {
  constexpr double max_correlation = 0.3, clearly = 0.9;
  if (!(std::abs(lag_one_correlation(flawed_misfit(log, fit))) > max_correlation)) return;
  const LinearFit start = searched(log, fit.kind, true);
  const auto rows = static_cast<double>(readings_of(thinned(log)).size());
  if (!(std::abs(start.difference) < 1.0) || start.sum2 > rows * fit.rms_rad * fit.rms_rad) return;
  ServoFit trial = fit;
  trial.params = start.params;
  trial.flaws = {.gain_difference = start.difference};
  trial.freed = {ServoFlaw::gain_difference};
  refine_flawed(log, 40, trial);
  trial.flaw_evidence = {};
  trial.flaw_evidence[ServoFlaw::gain_difference] =
      2.0 * effective_rows(flawed_misfit(log, trial)) * std::log(fit.rms_rad / trial.rms_rad);
  std::vector<ServoRival> others;
  trial = with_flaws(log, trial, flaws, others);
  if (!(trial.rms_rad < clearly * fit.rms_rad)) return;
  fit = trial;
  rivals = others;
}

Solution with_flaws_tried(std::vector<ServoSample> log, const std::array<ServoFit, 2>& fits, ServoKindRule rule) {
  Solution solution{std::move(log), fits, {}, 0, std::nullopt, {}, {}};
  // If one kind explains the log as it is, no flaws are added to the other.
  const std::vector<std::size_t> tried = indicated_flaws(solution.log, fits[believed_of(fits, rule)]);
  for (std::size_t kind = 0; kind < 2 && !tried.empty(); ++kind) {
    solution.fits[kind] = with_flaws(solution.log, fits[kind], tried, solution.rivals[kind]);
    if (std::ranges::count(tried, ServoFlaw::gain_difference) > 0)
      try_gain_by_sign(solution.log, tried, solution.fits[kind], solution.rivals[kind]);
  }
  solution.believed = believed_of(solution.fits, rule);
  return solution;
}

/// 2 ln of the likelihood ratio of a fit with flaws to one without, minus Schwarz's penalty for them.
double evidence_of_flaws(double rows, const ServoFit& plain, const ServoFit& flawed) {
  return 2.0 * rows * std::log(plain.rms_rad / flawed.rms_rad) -
         static_cast<double>(flawed.freed.size()) * std::log(rows);
}

bool is_white(std::span<const ServoSample> log, const ServoFit& fit) {
  constexpr double max_correlation = 0.3;
  return std::abs(lag_one_correlation(flawed_misfit(log, fit))) < max_correlation;
}

double price_of_faults(std::span<const ServoSample> log, const Solution& solution) {
  const double one = std::log(static_cast<double>(readings_of(log).size()));
  const std::size_t lost = solution.lost_commands.size();
  return 3.0 * one * static_cast<double>(solution.slips.size()) + (lost > 0 ? price_of_lost(log, lost) + one : 0.0);
}

/// A solution for a corrected log, and 2 ln of its likelihood ratio minus the penalty.
struct Explained {
  Solution solution;
  double evidence = 0.0;
};
double evidence_against(const Solution& before, const Solution& found) {
  const double rows = effective_rows(flawed_misfit(found.log, found.fit()));
  const double more = static_cast<double>(found.fit().freed.size()) - static_cast<double>(before.fit().freed.size());
  return 2.0 * rows * std::log(before.fit().rms_rad / found.fit().rms_rad) - more * std::log(rows);
}
Explained explained(const Solution& before, std::vector<ServoSample> log, ServoKindRule rule, double price) {
  const std::array<ServoFit, 2> fits{refined(log, ServoKind::angle, searched(log, ServoKind::angle).params),
                                     refined(log, ServoKind::rate, searched(log, ServoKind::rate).params)};
  Explained found{with_flaws_tried(std::move(log), fits, rule)};
  found.evidence = evidence_against(before, found.solution) - price;
  found.solution.times = before.times;
  found.solution.lost_commands = before.lost_commands;
  found.solution.slips = before.slips;
  return found;
}

/// The zero slip after alternating between refining the fit and estimating the slip.
std::optional<ZeroSlip> settled_slip(std::span<const ServoSample> log, ServoFit fit) {
  constexpr int rounds = 4, max_steps = 10;
  std::optional<ZeroSlip> slip = zero_slip(log, fit);
  for (int round = 0; round < rounds && slip; ++round) {
    refine_flawed(without_faults(log, {}, {*slip}), max_steps, fit);
    slip = zero_slip(log, fit);
  }
  return slip;
}

/// Lost commands or a slip of the encoder's zero, whichever explains more; no evidence if neither is found.
Explained with_a_fault(const Solution& before, ServoKindRule rule) {
  Explained best{before};
  const double rows = static_cast<double>(readings_of(before.log).size());
  const auto keep_better = [&](Explained trial) {
    if (trial.evidence > best.evidence) best = std::move(trial);
  };
  const bool may_be_lost = before.lost_commands.empty() && !before.times && !is_white(before.log, before.fit());
  for (const ServoKind kind : {ServoKind::angle, ServoKind::rate}) {
    const std::vector<std::size_t> lost = may_be_lost ? lost_commands(before.log, kind) : std::vector<std::size_t>();
    if (lost.empty()) continue;
    Explained trial = explained(before, without_faults(before.log, lost, {}), rule,
                                price_of_lost(before.log, lost.size()) + std::log(rows));
    trial.solution.lost_commands = lost;
    keep_better(std::move(trial));
  }
  ServoFit plain = before.fit();
  plain.flaws = {};
  plain.freed.clear();
  for (const ServoFit& start : {refined(before.log, plain.kind, plain.params), before.fit()}) {
    const std::optional<ZeroSlip> slip = settled_slip(before.log, start);
    if (!slip) continue;
    Explained trial = explained(before, without_faults(before.log, {}, {*slip}), rule, 3.0 * std::log(rows));
    if (!zero_slip(before.log, trial.solution.fit())) continue;  // the flaws estimated since explain it as well
    trial.solution.slips.push_back(*slip);
    keep_better(std::move(trial));
  }
  return best;
}

/// The solution with faults of the log that are not due to the axis, if they explain more than flaws
/// of the axis and leave no structure: effects of the axis beyond the model may look like either.
Solution with_faults_tried(const Solution& before, ServoKindRule rule) {
  constexpr double clear = 12.0;
  constexpr int most = 3;
  Solution now = before;
  for (int i = 0; i < most; ++i) {
    Explained next = with_a_fault(now, rule);
    if (!(next.evidence > clear)) break;
    now = std::move(next.solution);
  }
  return is_white(now.log, now.fit()) ? now : before;
}

/// As logged, or with commands given before their rows, if these explain more than flaws of the axis, lost commands
/// and slips do.
Solution without_resonance(std::span<const ServoSample> as_read, const std::vector<double>& sampled_t_s,
                           const Solution& plain, ServoKindRule rule) {
  const auto& [log, fits] = std::tie(plain.log, plain.fits);
  const Solution as_logged = with_faults_tried(with_flaws_tried(log, fits, rule), rule);
  if (log.size() != as_read.size()) return as_logged;  // it has commands between its rows
  const std::array<std::optional<CommandTimes>, 2> times{command_times(log, fits[0]), command_times(log, fits[1])};
  std::array<ServoFit, 2> earlier = fits;
  for (std::size_t kind = 0; kind < 2; ++kind)
    if (times[kind]) earlier[kind] = times[kind]->fit;
  const std::size_t kind = believed_of(earlier, rule);
  if (!times[kind]) return as_logged;
  const std::vector<ServoSample> timed = sampled_log(as_read, sampled_t_s, times[kind]->given_t_s);
  for (std::size_t i = 0; i < 2; ++i) earlier[i] = refined(timed, earlier[i].kind, earlier[i].params);
  Solution with_times = with_flaws_tried(timed, earlier, rule);
  if (with_times.believed != kind) return as_logged;
  with_times.times = times[kind];
  const double rows = static_cast<double>(readings_of(log).size());
  const double of_times = times[kind]->evidence + evidence_of_flaws(rows, earlier[kind], with_times.fit());
  const double otherwise = evidence_of_flaws(rows, fits[kind], as_logged.fit()) - price_of_faults(log, as_logged);
  return of_times > otherwise ? with_faults_tried(with_times, rule) : as_logged;
}

/// A fit of this log with a resonance, with the evidence against the selected solution.
std::optional<Explained> resonant(const Solution& base, const ServoFit& start, const Solution& believed) {
  std::optional<ServoFit> fit = with_resonance(base.log, start);
  if (!fit) return std::nullopt;
  Explained found{base};
  found.solution.believed = start.kind == ServoKind::rate ? 1 : 0;
  found.solution.fits[found.solution.believed] = *fit;
  found.solution.rivals[found.solution.believed].clear();
  found.evidence = evidence_against(believed, found.solution) + price_of_faults(base.log, believed) -
                   price_of_faults(base.log, base);
  return found;
}

/// The best fit with a resonance: of both kinds for the log as it is, and of the selected solution if that has more.
Explained most_resonant(const Solution& as_logged, const Solution& believed, ServoKindRule rule, bool is_asked) {
  constexpr double hopeless = 2.0, nothing = -std::numeric_limits<double>::infinity();
  Explained best{believed, nothing};
  const auto offer = [&](const Solution& base, const ServoFit& start) {
    auto trial = resonant(base, start, believed);
    if (trial && trial->evidence > best.evidence) best = *std::move(trial);
  };
  const double duration_s = as_logged.log.back().t_s - as_logged.log.front().t_s;
  for (const ServoFit& start : as_logged.fits) {
    const bool is_other = start.kind != as_logged.fit().kind;
    if (start.params[ServoParam::tau] > duration_s)
      continue;  // an angle plant with a lag longer than the log is in fact a rate plant
    if (is_other && (rule != ServoKindRule::automatic || start.rms_rad > hopeless * as_logged.fit().rms_rad)) continue;
    if (!believed.times) offer(as_logged, start);
  }
  const bool is_done = best.evidence > 0.0 && indicated_flaws(best.solution.log, best.solution.fit()).empty();
  if (is_asked && !is_done && (!believed.is_plain() || believed.times)) offer(believed, believed.fit());
  return best;
}

/// The solution with a resonance, if the log indicates one and it explains clearly more. Tried after everything
/// else, as many effects look like it, and never for commands of a single size, which do not distinguish these.
Solution with_resonance_tried(const Solution& as_logged, const Solution& believed, ServoKindRule rule) {
  constexpr std::size_t several = 2;
  constexpr double margin = 12.0, clear = 10.0, beside_others = 40.0;
  if (num_sizes(as_logged.log, several) < several) return believed;
  const bool is_asked = asks_for_resonance(believed.log, believed.fit());
  if (!is_asked && (believed.is_plain() || !asks_for_resonance(as_logged.log, as_logged.fit()))) return believed;
  Explained best = most_resonant(as_logged, believed, rule, is_asked);
  Solution& found = best.solution;
  if (is_asked && best.evidence > 0.0) {
    ServoFit& fit = found.fits[found.believed];
    fit = with_flaws(found.log, fit, indicated_flaws(found.log, fit), found.rivals[found.believed]);
    best.evidence =
        evidence_against(believed, found) + price_of_faults(found.log, believed) - price_of_faults(found.log, found);
  }
  const double least = found.fit().freed.size() > num_of_a_resonance ? beside_others
                       : believed.is_plain()                         ? margin
                                                                     : clear;
  if (best.evidence > least) return found;
  Solution result = believed;
  if (best.evidence > -clear && !believed.fit().freed.empty())
    result.rivals[result.believed].push_back(
        {believed.fit().freed.front(), ServoFlaw::resonance, std::max(0.0, -best.evidence)});
  return result;
}

/// Solution from the rows as read, and with the times at which an encoder was sampled.
Solution solved(std::span<const ServoSample> as_read, const std::vector<double>& sampled_t_s,
                const std::vector<ServoSample>& log, ServoKindRule rule) {
  const std::array<ServoFit, 2> fits{refined(log, ServoKind::angle, searched(log, ServoKind::angle).params),
                                     refined(log, ServoKind::rate, searched(log, ServoKind::rate).params)};
  const Solution as_logged{log, fits, {}, believed_of(fits, rule), std::nullopt, {}, {}};
  return with_resonance_tried(as_logged, without_resonance(as_read, sampled_t_s, as_logged, rule), rule);
}

/// As logged, or with commands between the rows, if these explain more than additional effects of the axis.
Solution with_commands_between_tried(const std::vector<ServoSample>& log, Solution as_logged, ServoKindRule rule,
                                     std::size_t& per_row) {
  const ServoKind kind = as_logged.fit().kind;
  per_row = commands_per_row(log, refined(log, kind, searched(log, kind).params));
  if (per_row == 0) return as_logged;
  Solution finer = solved(log, {}, with_commands_between(log, per_row), rule);
  if (evidence_against(as_logged, finer) + price_of_faults(log, as_logged) - price_of_faults(log, finer) > 0.0)
    return finer;
  per_row = 0;
  return as_logged;
}

/// A change of the axis at some time can look like clock drift or limits: then it is fitted without these.
void find_change(Solution& found, ServoIdentification& result) {
  const ServoFit& fit = found.fit();
  const bool drifts = std::ranges::any_of(
      fit.freed, [](std::size_t flaw) { return flaw == ServoFlaw::clock_rate || flaw == ServoFlaw::gain_drift; });
  if (found.times || (!drifts && is_white(found.log, fit))) return;
  result.change = servo_change(found.log, fit);
  if (!result.change) return;
  found.fits[found.believed] = result.change->whole;
  found.rivals[found.believed].clear();
}

void count_command_times(std::span<const ServoSample> log, const Solution& found, ServoIdentification& result) {
  const std::optional<CommandTimes>& times = found.times;
  if (times) {
    result.command_t_s = times->given_t_s;
    result.num_command_times = times->num;
    result.fit.cov += times->cov_added;
  }
  result.sigma_command_s = times ? times->sigma_offset_s : sigma_of_drifting_commands(log, result.fit);
  result.fit.cov(ServoParam::latency, ServoParam::latency) += result.sigma_command_s * result.sigma_command_s;
  result.has_frequent_commands &= !(result.sigma_command_s > 0.0) && result.fit.is_observable;
  if (!result.has_frequent_commands) return;
  const auto added = cov_of_commands_between(without_faults(log, found.lost_commands, found.slips), result.fit,
                                             result.commands_per_row);
  result.fit.cov += added;
  result.sigma_command_s = std::sqrt(added(ServoParam::latency, ServoParam::latency));
}

}  // namespace

ServoIdentification identify_servo(std::span<const ServoSample> as_read, ServoKindRule rule) {
  ServoIdentification result;
  const auto [low, high] = std::ranges::minmax_element(as_read, {}, &ServoSample::command);
  const auto [lowest, highest] = std::ranges::minmax_element(as_read, {}, &ServoSample::angle_rad);
  result.command_range = high->command - low->command;
  result.angle_range_rad = highest->angle_rad - lowest->angle_rad;
  result.duration_s = as_read.back().t_s - as_read.front().t_s;
  if (!(result.command_range > 0.0)) return result;
  const std::optional<HeldSampling> held = held_sampling(as_read);
  if (held) {
    result.encoder_hz = 1.0 / held->sampling.period_s;
    result.sampled_t_s = sampled_times(as_read, held->sampling);
  }
  const std::vector<ServoSample> rows = sampled_log(as_read, result.sampled_t_s);
  Solution found = solved(as_read, result.sampled_t_s, rows, rule);
  result.has_frequent_commands = !found.times && has_frequent_commands(as_read);
  if (result.has_frequent_commands)
    found = with_commands_between_tried(rows, std::move(found), rule, result.commands_per_row);
  find_change(found, result);
  const std::vector<ServoSample>& log = found.log;
  result.fit = found.fit();
  result.other = found.fits[1 - found.believed];
  result.rivals = found.rivals[found.believed];
  result.lost_commands = found.lost_commands;
  result.slips = found.slips;
  const bool is_plain = result.fit.freed.empty();
  const ServoResponse response = servo_response(log, result.fit.kind, result.fit.params);
  const Eigen::VectorXd residuals =
      (is_plain ? response.angle_rad : flawed_response(log, result.fit, result.fit.flaws)) - readings_of(log);
  result.residual_rad.assign(residuals.data(), residuals.data() + residuals.size());
  const Eigen::MatrixXd J =
      is_plain ? Eigen::MatrixXd(response.J) : with_open_lag(log, result.fit, flawed_jacobian(log, result.fit));
  set_clusters(log, with_slips(log, found.slips, J), result);
  result.status = status_of(result.fit);
  result.lag_one_correlation = lag_one_correlation(residuals);
  constexpr std::size_t several = 2;
  if (num_sizes(log, several) < several && result.fit.is_observable) result.hidden = hidden_flaws(log, result.fit);
  if (held) count_by_row(rows, held->sigma_phase_s, result);
  count_command_times(rows, found, result);
  for (ZeroSlip& slip : result.slips)
    slip.row = static_cast<std::size_t>(std::ranges::lower_bound(rows, slip.t_s, {}, &ServoSample::t_s) - rows.begin());
  return result;
}

}  // namespace alidade
