#include "alidade/servo/identify/positioner_fit.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/degree.h"
#include "alidade/servo/identify/positioner_problem.h"

namespace alidade {
namespace {

using P = PositionerPlace;
const std::vector<int> own_places{P::rate, P::acceleration, P::time_constant, P::latency, P::backlash, P::offset};
const std::vector<int> sampled_places{P::rate,     P::acceleration, P::time_constant, P::latency,
                                      P::backlash, P::offset,       P::sampling};
constexpr double boundless_acceleration_rad_s2 = 1e3, instant_s = 2e-3;

/// The largest rate that lasted for at least 0.15 s.
double fastest(const std::vector<PositionerReading>& readings) {
  constexpr double min_s = 0.15;
  double largest = 0.0;
  for (std::size_t i = 0, j = 0; j < readings.size(); ++j) {
    while (i + 1 < j && readings[j].t_s - readings[i + 1].t_s >= min_s) ++i;
    const double dt = readings[j].t_s - readings[i].t_s;
    if (dt >= min_s && dt < 1.0)
      largest = std::max(largest, std::abs(readings[j].angle_rad - readings[i].angle_rad) / dt);
  }
  return largest;
}

/// Median time from a command to the first change that is read [s].
double first_latency(const PositionerLog& log) {
  std::vector<double> waits;
  for (std::size_t i = 0; i < log.commands.size(); ++i) {
    const double from = log.commands[i].t_s;
    const double until = i + 1 < log.commands.size() ? log.commands[i + 1].t_s : 1e300;
    std::optional<double> before;
    for (const PositionerReading& reading : log.readings) {
      if (reading.t_s <= from) before = reading.angle_rad;
      if (reading.t_s <= from || reading.t_s > until || !before || reading.angle_rad == *before) continue;
      waits.push_back(reading.t_s - from);
      break;
    }
  }
  return waits.empty() ? 0.05 : median_of(std::move(waits));
}

/// Best fit from several points of a coarse grid, as the cost has local minima. All readings have full weight: with the
/// logarithmic loss, giving up a whole move can cost less than the sampling of an encoder does in total.
PositionerVector best_start(const PositionerProblem& problem, double rate, double latency) {
  constexpr std::size_t num_starts = 4;
  constexpr int few_steps = 20;
  PositionerProblem quadratic = problem;
  quadratic.set_threshold(1e300);
  std::vector<std::pair<double, PositionerVector>> grid;
  for (const double acceleration : {60.0, 120.0, 220.0, 400.0, 1e4})
    for (const double tau : {0.005, 0.05, 0.1, 0.15})
      for (const double share : {0.1, 0.4, 0.65, 0.85}) {
        PositionerVector theta;
        theta << std::log(std::max(rate, 1e-4)), std::log(acceleration * degree), std::log(tau), latency * share,
            0.05 * degree, 0.0, 0.0;
        grid.emplace_back(quadratic.misfit(theta).squaredNorm(), theta);
      }
  std::ranges::sort(grid, {}, &std::pair<double, PositionerVector>::first);
  PositionerVector best = grid.front().second;
  double cost = 1e300;
  const auto try_from = [&](PositionerVector theta) {
    const double reached = quadratic.solve(theta, own_places, few_steps);
    if (reached >= cost) return;
    cost = reached;
    best = theta;
  };
  for (std::size_t i = 0; i < num_starts; ++i) try_from(grid[i].second);
  for (const double side : {-1.0, 1.0}) {  // to leave a valley along which both compensate
    PositionerVector moved = best;
    moved[P::acceleration] += 0.2 * side;
    moved[P::latency] = std::max(0.0, moved[P::latency] + 0.006 * side);
    try_from(moved);
  }
  return best;
}

/// σ from the model's covariance, or from the scatter between moves if that is larger.
PositionerVector sigmas_of(const PositionerProblem& problem, const PositionerVector& theta,
                           const std::vector<int>& free, double noise2) {
  const Eigen::MatrixXd J = problem.jacobian(theta, free);
  const Eigen::VectorXd misfit = problem.misfit(theta);
  Eigen::MatrixXd normal = J.transpose() * J;
  for (int place = 0; place < P::count; ++place)
    if (!(normal(place, place) > 0.0)) normal(place, place) = 1e-300;
  const Eigen::VectorXd scale = normal.diagonal().cwiseMax(1e-200).cwiseSqrt();
  Eigen::MatrixXd scaled = scale.asDiagonal().inverse() * normal * scale.asDiagonal().inverse();
  scaled.diagonal().array() += 1e-10;
  const Eigen::MatrixXd inverse =
      scale.asDiagonal().inverse() * inverse_symmetric(scaled) * scale.asDiagonal().inverse();
  std::map<int, PositionerVector> scores;
  for (std::size_t i = 0; i < problem.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    auto [at, is_new] = scores.try_emplace(problem.move()[i], PositionerVector::Zero());
    at->second += J.row(row).transpose() * misfit[row];
  }
  Eigen::MatrixXd meat = Eigen::MatrixXd::Zero(P::count, P::count);
  for (const auto& [move, score] : scores) meat += score * score.transpose();
  const double clusters = static_cast<double>(scores.size());
  const Eigen::MatrixXd robust = inverse * meat * inverse * (clusters / std::max(1.0, clusters - 1.0));
  return (noise2 * inverse.diagonal()).cwiseMax(robust.diagonal()).cwiseMax(0.0).cwiseSqrt();
}

/// Increase of the cost if one parameter is fixed at zero and the others refitted: 2 ln of the likelihood ratio.
double evidence_of(const PositionerProblem& problem, PositionerVector theta, const std::vector<int>& free, int place,
                   double nothing, double noise2) {
  constexpr int few_steps = 20;
  const double with = problem.solve(theta, free, few_steps);
  std::vector<int> others;
  for (const int each : free)
    if (each != place) others.push_back(each);
  theta[place] = nothing;
  return (problem.solve(theta, others, few_steps) - with) / noise2;
}

void fill_dead_band(const PositionerLog& log, double step, PositionerFit& fit) {
  if (!log.smallest_obeyed_rad) {
    fit.dead_band = {0.0, std::nan(""), false, 0.0};
    return;
  }
  const double low = log.largest_ignored_rad, high = *log.smallest_obeyed_rad;
  const bool is_seen = low > 0.0;
  fit.dead_band.value = is_seen ? 0.5 * (low + high) : 0.0;
  fit.dead_band.sigma = is_seen ? std::hypot((high - low) / std::sqrt(12.0), 0.25 * step) : high / std::sqrt(3.0);
  fit.dead_band.is_asked_for = is_seen;
  fit.dead_band.evidence = is_seen ? 2.0 * low / std::max(step, 1e-9) : 0.0;
}

void fill_repeatability(const PositionerLog& log, double step, PositionerFit& fit) {
  const std::size_t n = log.repeated_rad.size();
  if (n < 3) {
    fit.repeatability = {0.0, std::nan(""), false, 0.0};
    return;
  }
  double mean = 0.0, sum2 = 0.0;
  for (const double each : log.repeated_rad) mean += each / static_cast<double>(n);
  for (const double each : log.repeated_rad) sum2 += (each - mean) * (each - mean);
  const double s = std::sqrt(sum2 / static_cast<double>(n - 1));
  fit.repeatability = {s, std::hypot(s / std::sqrt(2.0 * static_cast<double>(n - 1)), step / std::sqrt(12.0)), s > step,
                       s / std::max(step, 1e-9)};
}

/// Linear fit of the position at rest to the command.
void fill_gain(const PositionerLog& log, PositionerFit& fit) {
  constexpr double rested_s = 0.5;
  std::vector<Eigen::Vector2d> pairs;
  for (std::size_t i = 0; i + 1 < log.commands.size(); ++i) {
    const double until = log.commands[i + 1].t_s;
    const PositionerReading *last = nullptr, *before = nullptr;
    for (const PositionerReading& reading : log.readings) {
      if (reading.t_s <= log.commands[i].t_s || reading.t_s >= until) continue;
      before = last;
      last = &reading;
    }
    // A cached reading can also repeat while the axis moves.
    if (last != nullptr && before != nullptr && last->angle_rad == before->angle_rad &&
        last->t_s - log.commands[i].t_s > rested_s)
      pairs.emplace_back(log.commands[i].target_rad, last->angle_rad);
  }
  if (pairs.size() < 3) return;
  Eigen::MatrixXd A(static_cast<Eigen::Index>(pairs.size()), 2);
  Eigen::VectorXd y(A.rows());
  for (Eigen::Index i = 0; i < A.rows(); ++i) {
    A.row(i) << 1.0, pairs[static_cast<std::size_t>(i)][0];
    y[i] = pairs[static_cast<std::size_t>(i)][1];
  }
  const Eigen::Matrix2d normal = A.transpose() * A;
  if (!(normal.determinant() > 1e-12)) return;
  const Eigen::Vector2d line = normal.inverse() * A.transpose() * y;
  const double s2 = (A * line - y).squaredNorm() / std::max(1.0, static_cast<double>(A.rows() - 2));
  fit.gain = line[1];
  fit.sigma_gain = std::sqrt(s2 * normal.inverse()(1, 1));
}

/// A fit to the samples of the encoder.
struct SampledFit {
  PositionerProblem problem;
  PositionerVector theta;
  EncoderSampling sampling;
  double cost = 0.0;
};

/// Starting from a sampling and its latency, alternates between fitting the parameters and refining the sampling.
SampledFit fitted_to_samples(const PositionerProblem& as_asked, EncoderSampling sampling, PositionerVector theta) {
  constexpr int rounds = 4;
  SampledFit fit{as_asked, theta, sampling};
  for (int round = 0; round < rounds; ++round) {
    fit.problem = as_asked;
    fit.theta[P::sampling] = 0.0;
    fit.problem.set_sampling(fit.sampling, fit.theta);
    fit.cost = fit.problem.solve(fit.theta, sampled_places);
    fit.sampling = fit.problem.fitted(fit.sampling, fit.theta);
    if (round == 0) {  // the residuals at the times of requests determine it better now
      if (const auto again = as_asked.find_sampling(fit.theta)) fit.sampling = *again;
    } else if (round + 1 < rounds) {
      fit.sampling = fit.problem.refined(fit.sampling, fit.theta);
    }
  }
  return fit;
}

/// The fit to the times of requests can be so far off that readings are assigned to wrong samples, and stay
/// so: the cost has other minima, which leave readings unexplained. Starts again from the parameters found.
void leave_wrong_samples(const PositionerProblem& as_asked, double rate, SampledFit& best) {
  constexpr double unexplained = 2.0, latency_share = 0.4;  // share of the latency with which best_start() begins
  const auto explains = [&] { return best.cost < unexplained * static_cast<double>(as_asked.size()); };
  if (explains()) return;
  PositionerVector start = best_start(best.problem, rate, best.theta[P::latency] / latency_share);
  const double latency_s = best.theta[P::latency], period_s = best.sampling.period_s;
  for (const double cycles : {0.0, -0.1, 0.1, -0.25, 0.25}) {
    start[P::latency] = std::max(0.0, latency_s + cycles * period_s);
    SampledFit other = fitted_to_samples(as_asked, best.sampling, start);
    if (other.cost < best.cost) best = std::move(other);
    if (explains()) return;
  }
}

void find_sampling(PositionerProblem& problem, PositionerVector& theta, double& cost, PositionerFit& fit) {
  const std::optional<EncoderSampling> sampling = problem.find_sampling(theta);
  if (!sampling) return;
  PositionerVector start = theta;
  start[P::latency] = std::max(0.0, theta[P::latency] - 0.5 * sampling->period_s);
  SampledFit best = fitted_to_samples(problem, *sampling, start);
  leave_wrong_samples(problem, fit.fastest_rad_s, best);
  if (best.cost >= 2.0 * cost) return;
  fit.encoder_hz = 1.0 / best.sampling.period_s;
  problem = std::move(best.problem);
  theta = best.theta;
  cost = best.cost;
}

/// Whether long moves are complete at the first reading after the command.
bool reads_its_target(const PositionerLog& log) {
  constexpr double long_rad = 2.0 * degree, soon_s = 0.08;  // no drive starts and stops so soon
  int moves = 0, jumps = 0;
  for (std::size_t i = 1; i < log.commands.size(); ++i) {
    if (std::abs(log.commands[i].target_rad - log.commands[i - 1].target_rad) < long_rad) continue;
    const auto next = std::ranges::upper_bound(log.readings, log.commands[i].t_s, {}, &PositionerReading::t_s);
    if (next == log.readings.begin() || next == log.readings.end()) continue;
    const double way = std::abs(next->angle_rad - (next - 1)->angle_rad);
    ++moves;
    jumps += way > 0.9 * std::abs(log.commands[i].target_rad - log.commands[i - 1].target_rad) &&
             next->t_s - log.commands[i].t_s < soon_s;
  }
  return moves > 2 && 2 * jumps > moves;
}

double median_wait(const std::vector<double>& waits) { return waits.empty() ? 0.0 : median_of(waits); }

}  // namespace

std::vector<ServoSample> servo_samples(const PositionerLog& log) {
  std::vector<ServoSample> samples;
  if (log.readings.empty()) return samples;
  const double begin_s = log.readings.front().t_s;
  ServoSample row{-1.0, log.readings.front().angle_rad, 0.0};
  std::size_t next = 0;
  for (const PositionerReading& reading : log.readings) {
    const double before_s = row.t_s;
    if (reading.t_s - begin_s <= before_s) continue;
    row = {reading.t_s - begin_s, row.command, reading.angle_rad};
    for (; next < log.commands.size() && log.commands[next].t_s <= reading.t_s; ++next) {
      row.command = log.commands[next].target_rad;
      row.command_t_s = std::max(log.commands[next].t_s - begin_s, std::max(0.0, before_s));
    }
    samples.push_back(row);
  }
  return samples;
}

double reading_step(const std::vector<PositionerReading>& readings) {
  std::vector<double> angles;
  for (const PositionerReading& reading : readings) angles.push_back(reading.angle_rad);
  std::ranges::sort(angles);
  constexpr double same_rad = 1e-8;
  double step = 0.0;
  for (std::size_t i = 1; i < angles.size(); ++i) {
    const double apart = angles[i] - angles[i - 1];
    if (apart > same_rad && (step == 0.0 || apart < step)) step = apart;
  }
  if (!(step > 0.0)) return 0.0;
  const double whole = std::round((angles.back() - angles.front()) / step);  // a longer range determines it better
  return whole > 0.0 && whole < 1e5 ? (angles.back() - angles.front()) / whole : step;
}

namespace {

/// The optimum with its σ, and the threshold of evidence.
struct Optimum {
  PositionerVector theta, sigma;
  std::vector<int> free;
  double noise2 = 1.0;
  double least_evidence = 0.0;
};

Optimum solve(const PositionerLog& log, PositionerProblem& problem, PositionerFit& fit) {
  Optimum found{.theta = best_start(problem, fit.fastest_rad_s, first_latency(log))};
  double cost = problem.solve(found.theta, own_places);
  find_sampling(problem, found.theta, cost, fit);
  found.free = fit.encoder_hz > 0.0 ? sampled_places : own_places;
  const double mean = cost / static_cast<double>(problem.size() - found.free.size());
  fit.noise = std::sqrt(mean);
  found.noise2 = std::max(1.0, mean);
  found.sigma = sigmas_of(problem, found.theta, found.free, found.noise2);
  found.least_evidence = std::log(static_cast<double>(problem.size())) + 6.0;  // BIC, and a margin for model errors
  return found;
}

void fill_rate(const PositionerParams& params, const PositionerVector& sigma, PositionerFit& fit) {
  fit.reached_rate = params.rate_rad_s < 1.1 * fit.fastest_rad_s;
  fit.rate = {params.rate_rad_s, sigma[P::rate] * params.rate_rad_s, fit.reached_rate, 0.0};
  if (fit.reached_rate) return;
  fit.rate.value = std::max(fit.fastest_rad_s, std::min(params.rate_rad_s, 2.0 * fit.fastest_rad_s));
  fit.rate.sigma = std::max(fit.rate.sigma, 0.3 * fit.rate.value);
}

/// Parameters that a log may not show: acceleration, time constant, backlash.
void fill_tested(PositionerProblem& problem, const Optimum& found, double step, PositionerFit& fit) {
  const PositionerParams params = positioner_params(found.theta, fit.dead_band.value);
  const auto value = [&](int place, double nothing, double at, double sigma) {
    const double evidence = evidence_of(problem, found.theta, found.free, place, nothing, found.noise2);
    return decltype(fit.backlash){at, sigma, evidence > found.least_evidence, evidence};
  };
  fit.acceleration = value(P::acceleration, std::log(boundless_acceleration_rad_s2), params.acceleration_rad_s2,
                           found.sigma[P::acceleration] * params.acceleration_rad_s2);
  fit.time_constant = value(P::time_constant, std::log(instant_s), params.time_constant_s,
                            found.sigma[P::time_constant] * params.time_constant_s);
  // Neighbouring readings have the same rounding: their joint accuracy is limited to a quarter of a step.
  fit.backlash = value(P::backlash, 0.0, params.backlash_rad, std::hypot(found.sigma[P::backlash], 0.25 * step));
}

void fill_latency(const PositionerLog& log, const PositionerProblem& problem, const Optimum& found,
                  PositionerFit& fit) {
  constexpr double phase_share = 0.02;  // accuracy of the sampling phase, as a share of the period
  const double period = fit.encoder_hz > 0.0 ? 1.0 / fit.encoder_hz : 0.0;
  // The times of command and reading have a common offset up to the duration of the replies.
  std::vector<double> waits;
  for (const PositionerReading& reading : problem.readings()) waits.push_back(reading.wait_s);
  const double shared_s = std::hypot(median_wait(log.command_waits_s), median_wait(waits)) / std::sqrt(12.0);
  const double latency_s = positioner_params(found.theta, fit.dead_band.value).latency_s;
  fit.latency = {latency_s + 0.5 * period,
                 std::hypot(std::hypot(found.sigma[P::latency], shared_s), std::hypot(2e-4, phase_share * period)),
                 true, 0.0};
}

void fill_residuals(PositionerProblem& problem, const PositionerVector& theta, PositionerFit& fit) {
  fit.model_rad = problem.model(theta);
  double sum2 = 0.0;
  for (std::size_t i = 0; i < problem.size(); ++i) {
    fit.t_s.push_back(problem.readings()[i].t_s);
    fit.residual_rad.push_back(fit.model_rad[i] - problem.readings()[i].angle_rad);
    sum2 += fit.residual_rad.back() * fit.residual_rad.back();
  }
  fit.rms_rad = std::sqrt(sum2 / static_cast<double>(problem.size()));
}

}  // namespace

PositionerFit fit_positioner(const PositionerLog& log) {
  PositionerFit fit;
  if (log.readings.size() < 30 || log.commands.size() < 3) return fit;
  const double step = reading_step(log.readings);
  if (!(step > 0.0)) {
    fit.status = PositionerFit::Status::no_motion;
    return fit;
  }
  fit.status = PositionerFit::Status::ok;
  fit.resolution = {step, 0.02 * step, true, 0.0};
  fill_dead_band(log, step, fit);
  fill_repeatability(log, step, fit);
  fill_gain(log, fit);
  fit.reads_target = reads_its_target(log);
  PositionerProblem problem(log, step, fit.dead_band.value);
  if (problem.size() < 30) {
    fit.status = PositionerFit::Status::too_few;
    return fit;
  }
  fit.fastest_rad_s = fastest(problem.readings());
  const Optimum found = solve(log, problem, fit);
  fill_rate(positioner_params(found.theta, fit.dead_band.value), found.sigma, fit);
  fill_tested(problem, found, step, fit);
  fill_latency(log, problem, found, fit);
  heed_renewal(log, step, fit);
  fit.offset_rad = found.theta[P::offset];
  fit.sigma_offset_rad = found.sigma[P::offset];
  fill_residuals(problem, found.theta, fit);
  return fit;
}

}  // namespace alidade
