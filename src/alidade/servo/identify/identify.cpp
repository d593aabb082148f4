#include "alidade/servo/identify/identify.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include "alidade/geometry/decompositions.h"
#include "alidade/servo/identify/identify_causes.h"
#include "alidade/servo/identify/identify_clusters.h"
#include "alidade/servo/identify/identify_flaws.h"
#include "alidade/servo/identify/levenberg.h"
#include "alidade/servo/identify/log_times.h"
#include "alidade/servo/identify/ordinary_flaws.h"
#include "alidade/servo/identify/sampled_log.h"

namespace alidade {
namespace {

/// Gain, zero and start that fit best at a time constant and latency, and what is left.
struct LinearFit {
  ServoParams params = ServoParams::Zero();
  double difference = 0.0;  ///< Of the gain, by the command's sign.
  double sum2 = std::numeric_limits<double>::infinity();
};

/// The response to commands of one sign: by it a gain that differs by the sign changes the response.
Eigen::VectorXd rectified_response(std::span<const ServoSample> log, ServoKind kind, const ServoParams& params) {
  std::vector<ServoSample> rows(log.begin(), log.end());
  for (ServoSample& row : rows) row.command = std::abs(row.command);
  return servo_response(rows, kind, params).J.col(ServoParam::gain);
}

LinearFit linear_fit(std::span<const ServoSample> log, ServoKind kind, double tau_s, double latency_s,
                     const Eigen::VectorXd& readings, bool by_sign) {
  ServoParams params;
  params << 1.0, tau_s, latency_s, 0.0, 0.0;
  const ServoResponse response = servo_response(log, kind, params);
  Eigen::MatrixXd A(readings.size(), by_sign ? 4 : 3);  // the response is linear in these
  A.leftCols<3>() << response.J.col(ServoParam::gain), response.J.col(ServoParam::zero),
      response.J.col(ServoParam::start);
  if (by_sign) A.col(3) = rectified_response(log, kind, params);
  const Eigen::VectorXd best = least_squares(A, readings);
  LinearFit fit;
  fit.params << best[0], tau_s, latency_s, best[1], best[2];
  if (by_sign && best[0] != 0.0) fit.difference = best[3] / best[0];
  fit.sum2 = (A * best - readings).squaredNorm();
  return fit;
}

/// Every n-th row, so that a search over a long log stays short; commands between are piecewise constant.
std::vector<ServoSample> thinned(std::span<const ServoSample> log) {
  constexpr std::size_t most = 1500;
  const std::size_t stride = (log.size() + most - 1) / most;
  std::vector<ServoSample> rows;
  for (std::size_t i = 0; i < log.size(); ++i)
    if (i % stride == 0 || log[i].command != log[i - 1].command) rows.push_back(log[i]);
  return rows;
}

/// The best of a grid in time constant (by factors) and latency (up to a third of the log).
LinearFit searched(std::span<const ServoSample> log, ServoKind kind, bool by_sign = false) {
  const std::vector<ServoSample> rows = thinned(log);
  const Eigen::VectorXd readings = readings_of(rows);
  const double duration_s = log.back().t_s - log.front().t_s;
  const double step_s = duration_s / static_cast<double>(log.size() - 1);
  std::vector<double> latencies{0.0};
  for (double late_s = 0.5 * step_s; late_s < duration_s / 3.0; late_s *= 1.4) latencies.push_back(late_s);
  LinearFit best;
  for (double tau_s = 0.3 * step_s; tau_s < 3.0 * duration_s; tau_s *= 1.6) {
    for (const double latency_s : latencies) {
      const LinearFit fit = linear_fit(rows, kind, tau_s, latency_s, readings, by_sign);
      if (fit.sum2 < best.sum2) best = fit;
    }
  }
  return best;
}

/// (JᵀJ)⁻¹, by parameters scaled so that their units do not matter; none where it cannot be solved.
std::optional<Eigen::MatrixXd> inverse_normal(const Eigen::MatrixXd& J) {
  const Eigen::MatrixXd JtJ = J.transpose() * J;
  const Eigen::VectorXd scale = JtJ.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * JtJ * scale.asDiagonal();
  const Ldlt ldlt(scaled);
  if (!(ldlt.min_pivot() > 1e-10)) return std::nullopt;
  return scale.asDiagonal() * ldlt.inverse() * scale.asDiagonal();
}

/// Levenberg–Marquardt from there; time constant and latency stay within what has a meaning.
ServoFit refined(std::span<const ServoSample> log, ServoKind kind, ServoParams params) {
  const Eigen::VectorXd readings = readings_of(log);
  const double dof = static_cast<double>(readings.size()) - num_servo_params;
  // 5 to 15 steps are typical; a kink at a sampled latency takes more
  const LevenbergOutcome descent = levenberg(
      {.max_steps = 60, .first_damping = 1e-6, .tolerance = 1e-12}, params,
      [&](const ServoParams& at) -> Eigen::VectorXd { return servo_response(log, kind, at).angle_rad - readings; },
      [&](const ServoParams& at) { return servo_response(log, kind, at).J; },
      [](const ServoParams& from, const auto& step) { return within_meaning(from, ServoParams(from + step)); });
  ServoFit fit;
  fit.kind = kind;
  fit.has_converged = descent.has_converged;
  fit.params = params;
  fit.rms_rad = std::sqrt(descent.sum2 / dof);
  const auto inverse = inverse_normal(servo_response(log, kind, params).J);
  fit.is_observable = inverse.has_value();
  if (inverse) fit.cov = fit.cov_model = fit.rms_rad * fit.rms_rad * *inverse;
  return fit;
}

double lag_one(const std::vector<double>& residuals) {
  double product = 0.0, square = 0.0;
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    square += residuals[i] * residuals[i];
    if (i > 0) product += residuals[i] * residuals[i - 1];
  }
  return square > 0.0 ? product / square : 0.0;
}

/// What blocks of rows say of the covariance, in scaled parameters so that their units do not matter.
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
  count_ordinary_flaws(log, J, *inverse, result);
  count_time_stamps(log, J, *inverse, result);
}

/// Which flaws to try: all where the residuals of a linear fit indicate one of the axis, else those of the log alone.
std::vector<std::size_t> indicated_flaws(std::span<const ServoSample> log, const ServoFit& fit) {
  constexpr double max_correlation = 0.3, min_sigmas = 3.5;
  const FlawGround ground = flaw_ground(log, fit);
  const std::vector<double> residuals(ground.misfit.data(), ground.misfit.data() + ground.misfit.size());
  std::vector<std::size_t> all(num_servo_flaws);
  std::iota(all.begin(), all.end(), 0);
  if (std::abs(lag_one(residuals)) > max_correlation) return all;
  const double sum2 = ground.misfit.squaredNorm(), least2 = min_sigmas * min_sigmas * fit.rms_rad * fit.rms_rad;
  std::vector<std::size_t> indicated;
  for (const std::size_t flaw : all)
    if (sum2 > 0.0 && flaw_scores(log, fit, ground, flaw).front().gain2 > least2) indicated.push_back(flaw);
  const bool is_of_log = std::ranges::all_of(indicated, is_of_the_log);
  return is_of_log ? indicated : all;
}

/// The index of the selected one of two fits, angle and rate.
std::size_t believed_of(const std::array<ServoFit, 2>& fits, ServoKindRule rule) {
  // An angle plant with a very long lag looks like a rate plant: a tenth less is more than chance leaves.
  if (rule == ServoKindRule::automatic) return fits[1].rms_rad < 0.9 * fits[0].rms_rad ? 1 : 0;
  return rule == ServoKindRule::rate ? 1 : 0;
}

/// Of readings as of rows, and the latency that their phase leaves open.
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

/// Both kinds of plant, with what else the log shows of them.
struct Solution {
  std::vector<ServoSample> log;  ///< With the commands' times.
  std::array<ServoFit, 2> fits;
  std::array<std::vector<ServoRival>, 2> rivals;
  std::size_t believed = 0;
  std::optional<CommandTimes> times;
  std::vector<std::size_t> lost_commands;
  std::vector<ZeroSlip> slips;

  [[nodiscard]] const ServoFit& fit() const { return fits[believed]; }
};

/// A gain that differs by the command's sign makes a rate plant drift, which may be all that a search without it sees:
/// where structure is left, the fit with flaws from a search with it, if that leaves clearly less.
void try_gain_by_sign(std::span<const ServoSample> log, std::span<const std::size_t> flaws, ServoFit& fit,
                      std::vector<ServoRival>& rivals) {
  constexpr double max_correlation = 0.3, clearly = 0.9;
  const Eigen::VectorXd misfit = flawed_misfit(log, fit);
  if (!(std::abs(lag_one({misfit.data(), misfit.data() + misfit.size()})) > max_correlation)) return;
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
  // Where one kind explains the log as it is, the other is not made to.
  const std::vector<std::size_t> tried = indicated_flaws(solution.log, fits[believed_of(fits, rule)]);
  for (std::size_t kind = 0; kind < 2 && !tried.empty(); ++kind) {
    solution.fits[kind] = with_flaws(solution.log, fits[kind], tried, solution.rivals[kind]);
    if (std::ranges::count(tried, ServoFlaw::gain_difference) > 0)
      try_gain_by_sign(solution.log, tried, solution.fits[kind], solution.rivals[kind]);
  }
  solution.believed = believed_of(solution.fits, rule);
  return solution;
}

/// 2 ln of the likelihood ratio of a fit with flaws against another, less Schwarz's price of them.
double evidence_of_flaws(double rows, const ServoFit& plain, const ServoFit& flawed) {
  return 2.0 * rows * std::log(plain.rms_rad / flawed.rms_rad) -
         static_cast<double>(flawed.freed.size()) * std::log(rows);
}

bool is_white(std::span<const ServoSample> log, const ServoFit& fit) {
  constexpr double max_correlation = 0.3;
  const Eigen::VectorXd misfit = flawed_misfit(log, fit);
  return std::abs(lag_one({misfit.data(), misfit.data() + misfit.size()})) < max_correlation;
}

double price_of_faults(std::span<const ServoSample> log, const Solution& solution) {
  const double one = std::log(static_cast<double>(readings_of(log).size()));
  const std::size_t lost = solution.lost_commands.size();
  return 3.0 * one * static_cast<double>(solution.slips.size()) + (lost > 0 ? price_of_lost(log, lost) + one : 0.0);
}

/// A solution of the log as the axis had it, and 2 ln of its likelihood ratio less its price.
struct Explained {
  Solution solution;
  double evidence = 0.0;
};
Explained explained(const Solution& before, std::vector<ServoSample> log, ServoKindRule rule, double price) {
  const std::array<ServoFit, 2> fits{refined(log, ServoKind::angle, searched(log, ServoKind::angle).params),
                                     refined(log, ServoKind::rate, searched(log, ServoKind::rate).params)};
  Explained found{with_flaws_tried(std::move(log), fits, rule)};
  const ServoFit& fit = found.solution.fit();
  const double rows = effective_rows(flawed_misfit(found.solution.log, fit));
  const double more = static_cast<double>(fit.freed.size()) - static_cast<double>(before.fit().freed.size());
  found.evidence = 2.0 * rows * std::log(before.fit().rms_rad / fit.rms_rad) - more * std::log(rows) - price;
  found.solution.times = before.times;
  found.solution.lost_commands = before.lost_commands;
  found.solution.slips = before.slips;
  return found;
}

/// The slip that is left from this fit on, which follows it.
std::optional<ZeroSlip> settled_slip(std::span<const ServoSample> log, ServoFit fit) {
  constexpr int rounds = 4, max_steps = 10;
  std::optional<ZeroSlip> slip = zero_slip(log, fit);
  for (int round = 0; round < rounds && slip; ++round) {
    refine_flawed(without_faults(log, {}, {*slip}), max_steps, fit);
    slip = zero_slip(log, fit);
  }
  return slip;
}

/// Lost commands or a slip of the encoder's zero, whichever explains more; no evidence where neither is found.
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
    if (!zero_slip(before.log, trial.solution.fit())) continue;  // what is estimated since does it as well
    trial.solution.slips.push_back(*slip);
    keep_better(std::move(trial));
  }
  return best;
}

/// With what the log has that is none of the axis' doing, where that explains more than flaws of the axis do and leaves
/// nothing: what an axis does beside the model may look like either.
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

/// As logged; or with commands that were given before their rows, if they explain more than flaws of the axis, lost
/// commands and slips do.
Solution solved(std::span<const ServoSample> as_read, const std::vector<double>& sampled_t_s, ServoKindRule rule) {
  const std::vector<ServoSample> log = sampled_log(as_read, sampled_t_s);
  const std::array<ServoFit, 2> fits{refined(log, ServoKind::angle, searched(log, ServoKind::angle).params),
                                     refined(log, ServoKind::rate, searched(log, ServoKind::rate).params)};
  const Solution as_logged = with_faults_tried(with_flaws_tried(log, fits, rule), rule);
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

void count_command_times(std::span<const ServoSample> log, const std::optional<CommandTimes>& times,
                         ServoIdentification& result) {
  if (times) {
    result.command_t_s = times->given_t_s;
    result.num_command_times = times->num;
    result.fit.cov += times->cov_added;
  }
  result.sigma_command_s = times ? times->sigma_offset_s : sigma_of_drifting_commands(log, result.fit);
  result.fit.cov(ServoParam::latency, ServoParam::latency) += result.sigma_command_s * result.sigma_command_s;
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
  const Solution found = solved(as_read, result.sampled_t_s, rule);
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
  const Eigen::MatrixXd J = is_plain ? Eigen::MatrixXd(response.J) : flawed_jacobian(log, result.fit);
  set_clusters(log, with_slips(log, found.slips, J), result);
  result.status = status_of(result.fit);
  result.lag_one_correlation = lag_one(result.residual_rad);
  constexpr std::size_t several = 2;
  if (num_sizes(log, several) < several && result.fit.is_observable) result.hidden = hidden_flaws(log, result.fit);
  if (held) count_by_row(log, held->sigma_phase_s, result);
  count_command_times(as_read, found.times, result);
  return result;
}

}  // namespace alidade
