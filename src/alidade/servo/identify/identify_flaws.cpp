#include "alidade/servo/identify/identify_flaws.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "alidade/geometry/decompositions.h"
#include "alidade/pantilt/servo_plant.h"
#include "alidade/servo/identify/levenberg.h"

namespace alidade {
namespace {

using Eigen::Index;

enum Flaw : std::size_t { rate_limit, acceleration_limit, dead_band, backlash, second_lag };

constexpr double no_limit = 1e9;

/// A servo half-way through its log: an axis of gain and flaws as fitted, which counts its commands from zero.
class FlawedServo {
 public:
  FlawedServo(const ServoFit& fit, const ServoFlaws& flaws, double first_command)
      : fit_(fit), flaws_(flaws), lagged_(past_dead_band(first_command, flaws.dead_band)) {
    const double max_rate = flaws.max_rate_rad_s > 0.0 ? flaws.max_rate_rad_s : no_limit;
    if (fit.kind == ServoKind::angle) {
      AnglePlant plant{fit.params[ServoParam::gain], AngleUnit::rad, fit.params[ServoParam::tau]};
      if (flaws.max_rate_rad_s > 0.0) plant.max_rate_rad_s = max_rate;
      axis_.plant = plant;
      now_.angle_rad = fit.params[ServoParam::start];
    } else {
      RatePlant plant{fit.params[ServoParam::gain], AngleUnit::rad, fit.params[ServoParam::tau]};
      plant.max_rate_rad_s = max_rate;
      plant.max_acceleration_rad_s2 = flaws.max_acceleration_rad_s2 > 0.0 ? flaws.max_acceleration_rad_s2 : no_limit;
      axis_.plant = plant;
      now_.rate_rad_s = fit.params[ServoParam::start];
    }
    read_ = now_.angle_rad;
  }
  [[nodiscard]] double read_rad() const { return read_; }

  void advance(double dt_s, double command) {
    if (!(dt_s > 0.0)) return;
    const double goal = past_dead_band(command, flaws_.dead_band), lag_s = flaws_.second_tau_s;
    const bool is_hard = fit_.kind == ServoKind::angle && flaws_.max_acceleration_rad_s2 > 0.0;
    if (!(lag_s > 0.0) && !is_hard) {
      now_ = advanced(axis_, now_, goal, dt_s);
    } else {
      constexpr double per_tau = 20.0, max_steps = 40.0;
      const double shortest_s =
          lag_s > 0.0 ? std::min(lag_s, fit_.params[ServoParam::tau]) : fit_.params[ServoParam::tau];
      const double steps = std::clamp(std::ceil(per_tau * dt_s / shortest_s), 1.0, max_steps), step_s = dt_s / steps;
      for (double k = 0.0; k < steps; ++k) step(step_s, goal, is_hard);
    }
    const double half = 0.5 * flaws_.backlash_rad;
    read_ = std::clamp(read_, now_.angle_rad - half, now_.angle_rad + half);
  }

 private:
  void step(double dt_s, double goal, bool is_hard) {
    const double lag_s = flaws_.second_tau_s;
    double mean = goal;
    if (lag_s > 0.0) {
      const double rise = -std::expm1(-dt_s / lag_s);
      mean += (lagged_ - goal) * rise * lag_s / dt_s;
      lagged_ += rise * (goal - lagged_);
    }
    if (!is_hard) {
      now_ = advanced(axis_, now_, mean, dt_s);
      return;
    }
    advance_hard(dt_s, fit_.params[ServoParam::gain] * mean);
  }

  /// The rate required by the lag, approached within the limits: pieces of constant acceleration, of the largest rate
  /// and of the lag itself, each to its end. (Steps instead would read as a longer time constant.)
  void advance_hard(double dt_s, double goal_rad) {
    const double tau = fit_.params[ServoParam::tau], hardest = flaws_.max_acceleration_rad_s2;
    const double fastest = flaws_.max_rate_rad_s > 0.0 ? flaws_.max_rate_rad_s : no_limit;
    constexpr int max_pieces = 16;
    for (int piece = 0; piece < max_pieces && dt_s > 0.0; ++piece) {
      const double away = goal_rad - now_.angle_rad, asked = away / tau, rate = now_.rate_rad_s;
      const double wanted = std::clamp(asked, -fastest, fastest);
      const bool follows = std::abs(wanted - rate) <= 1e-9 * (std::abs(wanted) + hardest * tau);
      if (follows && wanted != asked) {
        const double t = std::min(dt_s, std::max((std::abs(asked) - fastest) * tau / fastest, 1e-9 * tau));
        now_.angle_rad += wanted * t;
        dt_s -= t;
      } else if (follows && std::abs(rate) <= hardest * tau * (1.0 + 1e-9)) {
        now_.angle_rad = goal_rad - away * std::exp(-dt_s / tau);
        now_.rate_rad_s = (goal_rad - now_.angle_rad) / tau;
        return;
      } else {
        const double pull = follows ? std::copysign(hardest, -rate) : std::copysign(hardest, wanted - rate);
        const double t = std::min(dt_s, piece_s(pull, rate, away, tau, fastest));
        now_.angle_rad += (rate + 0.5 * pull * t) * t;
        now_.rate_rad_s = rate + pull * t;
        dt_s -= t;
      }
    }
  }

  /// How long a constant acceleration lasts: until the rate is that of the lag, or the largest.
  static double piece_s(double pull, double rate, double away, double tau, double fastest) {
    const double shortest_s = 1e-9 * tau;
    double t = std::numeric_limits<double>::infinity();
    const auto ends = [&](double at_s) {
      if (at_s > shortest_s) t = std::min(t, at_s);
    };
    // rate + pull t = (away − rate t − pull t²/2) / tau
    const double b = rate + pull * tau, discriminant = b * b - 2.0 * pull * (rate * tau - away);
    if (discriminant >= 0.0) {
      ends((-b + std::sqrt(discriminant)) / pull);
      ends((-b - std::sqrt(discriminant)) / pull);
    }
    ends((std::copysign(fastest, pull) - rate) / pull);
    return t;
  }

  const ServoFit& fit_;
  const ServoFlaws& flaws_;
  ServoAxis axis_;
  AxisMotion now_;
  double lagged_, read_ = 0.0;
};

Eigen::VectorXd misfit_of(std::span<const ServoSample> log, const ServoFit& fit) {
  Eigen::VectorXd misfit = flawed_response(log, fit, fit.flaws);
  for (std::size_t i = 0; i < log.size(); ++i) misfit[static_cast<Index>(i)] -= log[i].angle_rad;
  return misfit;
}

/// What a step of one parameter or freed flaw makes of a fit; flaws, gains' and lags' sizes go by factors.
ServoFit moved(const ServoFit& fit, Index param, double by) {
  ServoFit next = fit;
  if (param < num_servo_params) {
    next.params[param] += by;
    next.params = within_meaning(fit.params, next.params);
  } else {
    const std::size_t flaw = fit.freed[static_cast<std::size_t>(param - num_servo_params)];
    double& size = next.flaws.*servo_flaws[flaw];
    size *= std::exp(std::clamp(by, -1.0, 1.0));
    // Of two lags one is the shorter: the second.
    if (flaw == second_lag) size = std::clamp(size, 0.02 * next.params[ServoParam::tau], next.params[ServoParam::tau]);
  }
  return next;
}

/// By how much a parameter is moved for a difference.
double step_of(std::span<const ServoSample> log, const ServoFit& fit, Index param) {
  const double spacing_s = (log.back().t_s - log.front().t_s) / static_cast<double>(log.size());
  switch (param) {
    case ServoParam::gain:
      return 1e-5 * std::abs(fit.params[ServoParam::gain]);
    case ServoParam::tau:
      return 1e-4 * fit.params[ServoParam::tau];
    case ServoParam::latency:
      return std::min(1e-3 * std::max(fit.params[ServoParam::tau], spacing_s), 0.01 * spacing_s);
    case ServoParam::zero:
    case ServoParam::start:
      return 1e-6;
    default:
      return 1e-4;
  }
}

/// ∂ / ∂ (parameters, ln of freed flaws).
Eigen::MatrixXd jacobian_by_factors(std::span<const ServoSample> log, const ServoFit& fit) {
  const auto num = static_cast<Index>(num_servo_params + fit.freed.size());
  Eigen::MatrixXd J(static_cast<Index>(log.size()), num);
  for (Index k = 0; k < num; ++k) {
    const double step = step_of(log, fit, k);
    const bool is_at_edge = k == ServoParam::latency && fit.params[ServoParam::latency] < step;
    const ServoFit more = moved(fit, k, step), less = moved(fit, k, is_at_edge ? 0.0 : -step);
    J.col(k) = (flawed_response(log, more, more.flaws) - flawed_response(log, less, less.flaws)) /
               (is_at_edge ? step : 2.0 * step);
  }
  return J;
}

/// Levenberg–Marquardt over parameters and freed flaws. Returns what is left of the squares.
double refine(std::span<const ServoSample> log, int max_steps, ServoFit& fit) {
  const auto after = [](const ServoFit& from, const Eigen::VectorXd& step) {
    ServoFit next = from;
    for (Index k = 0; k < step.size(); ++k) next = moved(next, k, step[k]);
    return next;
  };
  const LevenbergOutcome descent = levenberg(
      {.max_steps = max_steps, .first_damping = 1e-4, .tolerance = 1e-9, .ridge = 1e-18}, fit,
      [&](const ServoFit& at) { return misfit_of(log, at); },
      [&](const ServoFit& at) { return jacobian_by_factors(log, at); }, after);
  fit.has_converged = descent.has_converged;
  const double dof = static_cast<double>(log.size()) - num_servo_params - static_cast<double>(fit.freed.size());
  fit.rms_rad = std::sqrt(descent.sum2 / std::max(1.0, dof));
  return descent.sum2;
}

/// Rows that do not share errors: of an AR(1) noise with the residuals' correlation from row to row.
double effective_rows(const Eigen::VectorXd& misfit) {
  const Index n = misfit.size();
  const double colour =
      std::clamp(misfit.head(n - 1).dot(misfit.tail(n - 1)) / std::max(misfit.squaredNorm(), 1e-300), 0.0, 0.95);
  return static_cast<double>(n) * (1.0 - colour) / (1.0 + colour);
}

struct Candidate {
  std::size_t flaw = 0;
  ServoFit fit;
  double sum2 = std::numeric_limits<double>::infinity();
};

double max_command(std::span<const ServoSample> log) {
  double most = 0.0;
  for (const ServoSample& row : log) most = std::max(most, std::abs(row.command));
  return most;
}

double max_rate(std::span<const ServoSample> log, const Eigen::VectorXd& response) {
  double most = 0.0;
  for (std::size_t i = 1; i < log.size(); ++i) {
    const auto at = static_cast<Index>(i);
    most = std::max(most, std::abs(response[at] - response[at - 1]) / (log[i].t_s - log[i - 1].t_s));
  }
  return most;
}

std::vector<double> sizes_of(std::span<const ServoSample> log, const ServoFit& fit, const Eigen::VectorXd& response,
                             std::size_t flaw) {
  const auto times = [](double unit, std::initializer_list<double> factors) {
    std::vector<double> sizes;
    for (const double factor : factors) sizes.push_back(unit * factor);
    return sizes;
  };
  switch (flaw) {
    case rate_limit:
      return times(max_rate(log, response), {0.95, 0.9, 0.8, 0.65, 0.5, 0.35, 0.2, 0.1});
    case acceleration_limit:
      return times(max_rate(log, response) / fit.params[ServoParam::tau], {0.9, 0.7, 0.5, 0.3, 0.15});
    case dead_band:
      return times(max_command(log), {0.005, 0.01, 0.02, 0.05, 0.1, 0.2});
    case backlash:
      return times(response.maxCoeff() - response.minCoeff(), {0.002, 0.005, 0.01, 0.02, 0.05, 0.1});
    default:
      return times(fit.params[ServoParam::tau], {0.1, 0.3, 0.6, 1.0});
  }
}

}  // namespace

Eigen::VectorXd flawed_response(std::span<const ServoSample> log, const ServoFit& fit, const ServoFlaws& flaws) {
  Eigen::VectorXd angles(static_cast<Index>(log.size()));
  FlawedServo servo(fit, flaws, log.front().command);
  double now_s = log.front().t_s, command = log.front().command;
  std::size_t next = 1;
  for (std::size_t i = 0; i < log.size(); ++i) {
    for (; next < log.size() && log[next].t_s + fit.params[ServoParam::latency] <= log[i].t_s; ++next) {
      if (log[next].command == command) continue;
      servo.advance(log[next].t_s + fit.params[ServoParam::latency] - now_s, command);
      now_s = log[next].t_s + fit.params[ServoParam::latency];
      command = log[next].command;
    }
    servo.advance(log[i].t_s - now_s, command);
    now_s = log[i].t_s;
    angles[static_cast<Index>(i)] = fit.params[ServoParam::zero] + servo.read_rad();
  }
  return angles;
}

Eigen::MatrixXd flawed_jacobian(std::span<const ServoSample> log, const ServoFit& fit) {
  Eigen::MatrixXd J = jacobian_by_factors(log, fit);
  for (std::size_t i = 0; i < fit.freed.size(); ++i)
    J.col(num_servo_params + static_cast<Index>(i)) /= fit.flaws.*servo_flaws[fit.freed[i]];
  return J;
}

FlawGround flaw_ground(std::span<const ServoSample> log, const ServoFit& fit) {
  const Eigen::MatrixXd J = jacobian_by_factors(log, fit);
  FlawGround ground{flawed_response(log, fit, fit.flaws), {}, orthonormal_basis(J, J.cols())};
  ground.misfit = misfit_of(log, fit);
  return ground;
}

std::vector<FlawScore> flaw_scores(std::span<const ServoSample> log, const ServoFit& fit, const FlawGround& ground,
                                   std::size_t flaw) {
  std::vector<FlawScore> scores;
  for (const double size : sizes_of(log, fit, ground.response, flaw)) {
    ServoFlaws flaws = fit.flaws;
    flaws.*servo_flaws[flaw] = size;
    Eigen::VectorXd added = flawed_response(log, fit, flaws) - ground.response;
    added -= ground.across * (ground.across.transpose() * added);  // the parameters follow
    const double own2 = added.squaredNorm(), along = -added.dot(ground.misfit);
    // Only in the flaw's own direction, and nothing where the parameters can do all that it does.
    const bool shows = own2 > 1e-3 * fit.rms_rad * fit.rms_rad && along > 0.0;
    scores.push_back({size, shows ? along * along / own2 : 0.0});
  }
  std::ranges::stable_sort(scores, std::ranges::greater{}, &FlawScore::gain2);
  return scores;
}

namespace {

/// The fit with one more flaw, from the two sizes that explain most.
Candidate freed(std::span<const ServoSample> log, const ServoFit& fit, const FlawGround& ground, std::size_t flaw) {
  constexpr std::size_t max_starts = 2;
  constexpr int first_steps = 8, max_steps = 40;
  const std::vector<FlawScore> scores = flaw_scores(log, fit, ground, flaw);
  Candidate best{flaw, fit};
  for (std::size_t i = 0; i < std::min(max_starts, scores.size()); ++i) {
    ServoFit trial = fit;
    trial.freed.push_back(flaw);
    trial.flaws.*servo_flaws[flaw] = scores[i].size;
    const double sum2 = refine(log, first_steps, trial);
    if (sum2 < best.sum2) best = {flaw, trial, sum2};
  }
  if (std::isfinite(best.sum2)) best.sum2 = refine(log, max_steps, best.fit);
  return best;
}

}  // namespace

ServoFit with_flaws(std::span<const ServoSample> log, const ServoFit& plain, std::vector<ServoRival>& rivals) {
  constexpr std::size_t max_freed = 3;
  constexpr double margin = 12.0, clear = 10.0;
  ServoFit fit = plain;
  while (fit.freed.size() < max_freed) {
    const FlawGround ground = flaw_ground(log, fit);
    const double sum2 = ground.misfit.squaredNorm();
    std::vector<Candidate> candidates;
    for (std::size_t flaw = 0; flaw < num_servo_flaws; ++flaw)
      if (std::ranges::count(fit.freed, flaw) == 0) candidates.push_back(freed(log, fit, ground, flaw));
    std::ranges::sort(candidates, {}, &Candidate::sum2);
    const Candidate& best = candidates.front();
    if (!std::isfinite(best.sum2)) break;
    const double rows = effective_rows(misfit_of(log, best.fit));
    if (!(rows * std::log(sum2 / best.sum2) > std::log(rows) + margin)) break;
    for (std::size_t i = 1; i < candidates.size(); ++i) {
      const double evidence = rows * std::log(candidates[i].sum2 / best.sum2);
      if (evidence < clear) rivals.push_back({best.flaw, candidates[i].flaw, evidence});
    }
    fit = best.fit;
  }
  return fit;
}

std::vector<HiddenFlaw> hidden_flaws(std::span<const ServoSample> log, const ServoFit& fit) {
  constexpr double share = 0.05, min_evidence = 9.0, min_moved = 0.005;
  const Eigen::VectorXd response = flawed_response(log, fit, fit.flaws);
  const double sum2 = misfit_of(log, fit).squaredNorm(), range = response.maxCoeff() - response.minCoeff();
  std::vector<HiddenFlaw> hidden;
  const auto ask = [&](std::size_t flaw, double size) {
    if (std::ranges::count(fit.freed, flaw) > 0 || !(size > 0.0)) return;
    ServoFit trial = fit;
    trial.flaws.*servo_flaws[flaw] = size;
    if (flaw == rate_limit && fit.kind == ServoKind::rate) trial.params[ServoParam::gain] *= 1.0 + share;
    const double with2 = refine(log, 40, trial);
    const double rows = effective_rows(misfit_of(log, trial));
    const double factor = trial.params[ServoParam::gain] / fit.params[ServoParam::gain];
    if (rows * std::log(with2 / sum2) < min_evidence && std::abs(factor - 1.0) > min_moved)
      hidden.push_back({flaw, size, factor});
  };
  ask(dead_band, share * max_command(log));
  ask(backlash, 0.5 * share * range);
  if (fit.kind == ServoKind::rate) ask(rate_limit, max_rate(log, response));
  return hidden;
}

}  // namespace alidade
