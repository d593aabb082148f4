#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "alidade/geometry/decompositions.h"
#include "alidade/servo/identify/identify_flaws.h"
#include "alidade/servo/identify/levenberg.h"
#include "alidade/servo/identify/log_times.h"
#include "alidade/servo/identify/sampled_log.h"

// Times of commands that were given before the row in which the log has them.

namespace alidade {
namespace {

using Eigen::Index;

/// How much earlier than its row a command may have been given: uniformly distributed up to `most_s`.
struct EarlierCommand {
  std::size_t row = 0;
  double most_s = 0.0, mean_s = 0.0, sigma_s = 0.0;
};

/// For every changed command, if commands are given between rows; if they are given at rows, for those whose
/// row may have been lost.
std::vector<EarlierCommand> earlier_commands(std::span<const ServoSample> log, bool between_rows) {
  constexpr double lost = 1.5;
  const double spacing_s = usual_spacing(log);
  std::vector<EarlierCommand> earlier;
  for (std::size_t i = 1; i < log.size(); ++i) {
    if (log[i].command == log[i - 1].command || std::isfinite(log[i].command_t_s)) continue;
    const double gap_s = log[i].t_s - log[i - 1].t_s;
    if (between_rows) {
      earlier.push_back({i, gap_s, 0.5 * gap_s, gap_s / std::sqrt(12.0)});
    } else if (gap_s > lost * spacing_s) {
      const double num = std::round(gap_s / spacing_s);  // number of rows where it may have been given, with this one
      const double most_s = gap_s - spacing_s;
      earlier.push_back({i, most_s, 0.5 * most_s, spacing_s * std::sqrt((num * num - 1.0) / 12.0)});
    }
  }
  return earlier;
}

/// ∂ response / ∂ (lead of each command): the effect of a command, a little sooner.
Eigen::MatrixXd by_earlier(std::span<const ServoSample> log, const ServoFit& fit,
                           std::span<const EarlierCommand> earlier) {
  const std::vector<double> times_s = reading_times(log);
  const double tau_s = fit.params[ServoParam::tau], gain = fit.params[ServoParam::gain];
  Eigen::MatrixXd by = Eigen::MatrixXd::Zero(static_cast<Index>(times_s.size()), static_cast<Index>(earlier.size()));
  for (std::size_t j = 0; j < earlier.size(); ++j) {
    const std::size_t row = earlier[j].row;
    const double acts_s = log[row].given_s() + fit.params[ServoParam::latency];
    const double pull = gain * (log[row].command - log[row - 1].command);
    for (std::size_t i = 0; i < times_s.size(); ++i) {
      const double since_s = times_s[i] - acts_s;
      if (since_s < 0.0) continue;
      by(static_cast<Index>(i), static_cast<Index>(j)) = fit.kind == ServoKind::angle
                                                             ? pull / tau_s * std::exp(-since_s / tau_s)
                                                             : -pull * std::expm1(-since_s / tau_s);
    }
  }
  return by;
}

/// The parameters and the lead of each command as one state.
struct Joint {
  ServoFit fit;
  Eigen::VectorXd earlier_s;
  std::vector<ServoSample> log;
  Eigen::VectorXd misfit;
  double sum2 = std::numeric_limits<double>::infinity();
};

class JointProblem {
 public:
  JointProblem(std::span<const ServoSample> log, std::vector<EarlierCommand> earlier)
      : log_(log), earlier_(std::move(earlier)), readings_(readings_of(log)) {}

  [[nodiscard]] Joint at(const ServoFit& fit, const Eigen::VectorXd& earlier_s) const {
    Joint joint{fit, earlier_s, {log_.begin(), log_.end()}, {}};
    for (std::size_t j = 0; j < earlier_.size(); ++j) {
      ServoSample& row = joint.log[earlier_[j].row];
      row.command_t_s = row.t_s - earlier_s[static_cast<Index>(j)];
    }
    joint.misfit = servo_response(joint.log, fit.kind, fit.params).angle_rad - readings_;
    joint.sum2 = joint.misfit.squaredNorm();
    return joint;
  }
  [[nodiscard]] Joint start(const ServoFit& fit) const {
    Eigen::VectorXd earlier_s(static_cast<Index>(earlier_.size()));
    for (std::size_t j = 0; j < earlier_.size(); ++j) earlier_s[static_cast<Index>(j)] = earlier_[j].mean_s;
    return at(fit, earlier_s);
  }
  [[nodiscard]] Eigen::MatrixXd jacobian(const Joint& joint) const {
    const auto num = static_cast<Index>(earlier_.size());
    Eigen::MatrixXd J(readings_.size(), num_servo_params + num);
    J << servo_response(joint.log, joint.fit.kind, joint.fit.params).J, by_earlier(joint.log, joint.fit, earlier_);
    return J;
  }
  /// Per degree of freedom of the parameters only: the times of commands have a prior.
  [[nodiscard]] double variance(const Joint& joint) const {
    return joint.sum2 / (static_cast<double>(readings_.size()) - num_servo_params);
  }
  /// The normal matrix with the prior of the leads: no command is earlier than the row before its own.
  [[nodiscard]] Eigen::MatrixXd normal(const Eigen::MatrixXd& J, double variance) const {
    Eigen::MatrixXd normal = J.transpose() * J / variance;
    for (std::size_t j = 0; j < earlier_.size(); ++j) {
      const Index at = num_servo_params + static_cast<Index>(j);
      normal(at, at) += std::pow(earlier_[j].sigma_s, -2);
    }
    return normal;
  }
  [[nodiscard]] double cost(const Joint& joint, double variance) const {
    double sum = joint.sum2 / variance;
    for (std::size_t j = 0; j < earlier_.size(); ++j)
      sum += std::pow((joint.earlier_s[static_cast<Index>(j)] - earlier_[j].mean_s) / earlier_[j].sigma_s, 2);
    return sum;
  }
  /// −A⁻¹ right, with leads that would leave their bounds fixed at these.
  [[nodiscard]] Eigen::VectorXd bounded_step(const Eigen::MatrixXd& A, const Eigen::VectorXd& right,
                                             const Eigen::VectorXd& earlier_s) const {
    constexpr int rounds = 8;
    const Eigen::VectorXd scale = A.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
    Eigen::VectorXd step = Eigen::VectorXd::Zero(right.size());
    std::vector<Index> free(static_cast<std::size_t>(right.size()));
    std::iota(free.begin(), free.end(), 0);
    for (int round = 0; round < rounds; ++round) {
      Eigen::VectorXd held = step;
      held(free).setZero();
      const Eigen::VectorXd own = scale(free), left = own.cwiseProduct((right + A * held)(free));
      const Eigen::MatrixXd scaled = own.asDiagonal() * A(free, free) * own.asDiagonal();
      step = held;
      step(free) = -own.cwiseProduct(solve_symmetric(scaled, left));
      const auto is_beyond = [&](Index k) {
        if (k < num_servo_params) return false;
        double& by = step[k];
        const double now_s = earlier_s[k - num_servo_params];
        const double within =
            std::clamp(now_s + by, 0.0, earlier_[static_cast<std::size_t>(k - num_servo_params)].most_s);
        const bool beyond = within != now_s + by;
        if (beyond) by = within - now_s;
        return beyond;
      };
      if (std::erase_if(free, is_beyond) == 0) break;
    }
    return step;
  }
  /// One Gauss–Newton step, halved until the cost decreases; the noise is estimated from the current residuals.
  [[nodiscard]] Joint stepped(const Joint& joint) const {
    const double noise2 = variance(joint), before = cost(joint, noise2);
    const Eigen::MatrixXd J = jacobian(joint), A = normal(J, noise2);
    Eigen::VectorXd right = J.transpose() * joint.misfit / noise2;
    for (std::size_t j = 0; j < earlier_.size(); ++j) {
      const auto k = static_cast<Index>(j);
      right[num_servo_params + k] += (joint.earlier_s[k] - earlier_[j].mean_s) / std::pow(earlier_[j].sigma_s, 2);
    }
    Eigen::VectorXd step = bounded_step(A, right, joint.earlier_s);
    constexpr int halvings = 5;
    for (int k = 0; k < halvings; ++k, step *= 0.5) {
      ServoFit fit = joint.fit;
      fit.params = within_meaning(fit.params, fit.params + ServoParams(step.head<num_servo_params>()));
      Eigen::VectorXd earlier_s = joint.earlier_s + step.tail(joint.earlier_s.size());
      for (std::size_t j = 0; j < earlier_.size(); ++j) {
        double& each = earlier_s[static_cast<Index>(j)];
        each = std::clamp(each, 0.0, earlier_[j].most_s);
      }
      Joint next = at(fit, earlier_s);
      if (cost(next, noise2) < before) return next;
    }
    return joint;
  }
  [[nodiscard]] std::size_t size() const { return earlier_.size(); }

 private:
  std::span<const ServoSample> log_;
  std::vector<EarlierCommand> earlier_;
  Eigen::VectorXd readings_;
};

/// Covariance of the parameters due to uncertain command times, beyond that for known times.
decltype(ServoFit::cov) of_times(const Eigen::MatrixXd& A) {
  const Eigen::VectorXd scale = A.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * A * scale.asDiagonal();
  const Eigen::MatrixXd all = Ldlt(scaled).inverse();
  const Eigen::MatrixXd known = Ldlt(scaled.topLeftCorner<num_servo_params, num_servo_params>()).inverse();
  const auto own = scale.head<num_servo_params>().asDiagonal();
  return own * (all.topLeftCorner<num_servo_params, num_servo_params>() - known) * own;
}

/// Whether one linearisation indicates the leads: if the logged times are correct, each explains σ² on average.
bool is_indicated(const JointProblem& problem, const Joint& as_logged) {
  constexpr double sigmas = 5.0;
  const Eigen::MatrixXd J = problem.jacobian(as_logged);
  const Eigen::MatrixXd own = J.leftCols(num_servo_params), across = orthonormal_basis(own, num_servo_params);
  Eigen::MatrixXd added = J.rightCols(static_cast<Index>(problem.size()));
  added -= across * (across.transpose() * added);
  const Eigen::VectorXd explained = added * minimum_norm_solution(added, as_logged.misfit);
  const auto num = static_cast<double>(problem.size());
  return explained.squaredNorm() > (num + sigmas * std::sqrt(2.0 * num)) * problem.variance(as_logged);
}

/// Command times of one kind, estimated with the parameters; none if the log does not indicate them.
std::optional<CommandTimes> estimated(std::span<const ServoSample> log, const ServoFit& fit, bool between_rows) {
  constexpr std::size_t most = 60;  // in a chirp every row has a new command
  constexpr int max_steps = 20;
  const std::vector<EarlierCommand> earlier = earlier_commands(log, between_rows);
  if (earlier.empty() || earlier.size() > most || 8 * earlier.size() > log.size()) return std::nullopt;
  const JointProblem problem(log, earlier);
  const Joint as_logged = problem.at(fit, Eigen::VectorXd::Zero(static_cast<Index>(earlier.size())));
  if (!(as_logged.sum2 > 0.0) || !is_indicated(problem, as_logged)) return std::nullopt;
  Joint joint = problem.start(fit);
  for (int step = 0; step < max_steps; ++step) {
    const double before = joint.sum2;
    joint = problem.stepped(joint);
    if (std::abs(before - joint.sum2) <= 1e-9 * before) break;
  }
  const double noise2 = problem.variance(joint);
  const Eigen::MatrixXd J = problem.jacobian(joint), own = J.leftCols(num_servo_params);
  const Eigen::MatrixXd A = problem.normal(J, noise2);
  // Laplace approximation: the leads are marginalised, so that one that the log does not determine costs nothing.
  double price = log_determinant(A) - log_determinant(own.transpose() * own / noise2);
  for (const EarlierCommand& each : earlier) price += 2.0 * std::log(each.sigma_s);
  CommandTimes times{joint.fit, {}, earlier.size(), of_times(A), 0.0};
  times.evidence = effective_rows(joint.misfit) * std::log(as_logged.sum2 / joint.sum2) -
                   (problem.cost(joint, noise2) - joint.sum2 / noise2) - price;
  times.fit.rms_rad = std::sqrt(noise2);
  for (const ServoSample& row : joint.log) times.given_t_s.push_back(row.command_t_s);
  if (!times.cov_added.allFinite() || !std::isfinite(times.evidence)) return std::nullopt;
  return times;
}

}  // namespace

double usual_spacing(std::span<const ServoSample> log) {
  std::vector<double> spacings;
  for (std::size_t i = 1; i < log.size(); ++i) spacings.push_back(log[i].t_s - log[i - 1].t_s);
  std::ranges::nth_element(spacings, spacings.begin() + static_cast<std::ptrdiff_t>(spacings.size() / 2));
  return spacings[spacings.size() / 2];
}

std::optional<CommandTimes> command_times(std::span<const ServoSample> log, const ServoFit& fit) {
  constexpr double clear = 12.0;
  const auto evidence_of = [](const std::optional<CommandTimes>& times) { return times ? times->evidence : 0.0; };
  std::optional<CommandTimes> lost = estimated(log, fit, false), between = estimated(log, fit, true);
  std::optional<CommandTimes>& best = evidence_of(between) > evidence_of(lost) ? between : lost;
  if (!(evidence_of(best) > clear)) return std::nullopt;
  // Commands between rows remain possible: these may be up to a row earlier, with any distribution.
  if (evidence_of(lost) < evidence_of(between) + clear) best->sigma_offset_s = usual_spacing(log) / std::sqrt(12.0);
  return best;
}

double sigma_of_drifting_commands(std::span<const ServoSample> log, const ServoFit& fit) {
  if (std::ranges::count(fit.freed, ServoFlaw::clock_rate) == 0) return 0.0;
  if (std::ranges::any_of(log, [](const ServoSample& row) { return std::isfinite(row.command_t_s); })) return 0.0;
  const double duration_s = log.back().t_s - log.front().t_s, row_s = usual_spacing(log);
  const double drift_s = duration_s * std::abs(fit.flaws.clock_rate);
  const double sigma_s = duration_s * fit.flaw_sigma[ServoFlaw::clock_rate];
  return drift_s <= row_s + 3.0 * sigma_s ? row_s / std::sqrt(3.0) : 0.0;
}

}  // namespace alidade
