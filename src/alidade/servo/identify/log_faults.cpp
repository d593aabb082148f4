#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/servo/identify/identify_flaws.h"
#include "alidade/servo/identify/sampled_log.h"

// Commands that the axis did not follow, and slips of the encoder's zero.

namespace alidade {
namespace {

using Eigen::Index;

/// A row whose command differs from the one before.
struct CommandChange {
  std::size_t row = 0;
  double given_s = 0.0, by = 0.0;
};

std::vector<CommandChange> changes_of(std::span<const ServoSample> log) {
  std::vector<CommandChange> changes;
  for (std::size_t i = 1; i < log.size(); ++i)
    if (log[i].command != log[i - 1].command)
      changes.push_back({i, log[i].given_s(), log[i].command - log[i - 1].command});
  return changes;
}

/// The response to the steps of the commands, linear in the effect of each.
class StepResponses {
 public:
  StepResponses(std::span<const ServoSample> log, ServoKind kind, std::vector<CommandChange> changes)
      : kind_(kind), changes_(std::move(changes)) {
    constexpr std::size_t most = 1500;
    const std::vector<double> times_s = reading_times(log);
    const Eigen::VectorXd readings = readings_of(log);
    const std::size_t stride = (times_s.size() + most - 1) / most;
    for (std::size_t i = 0; i < times_s.size(); i += stride) times_s_.push_back(times_s[i]);
    readings_.resize(static_cast<Index>(times_s_.size()));
    for (Index i = 0; i < readings_.size(); ++i) readings_[i] = readings[i * static_cast<Index>(stride)];
  }

  /// Columns: zero, start, and a unit step at each change.
  [[nodiscard]] Eigen::MatrixXd at(double tau_s, double latency_s) const {
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(readings_.size(), 2 + static_cast<Index>(changes_.size()));
    const bool is_rate = kind_ == ServoKind::rate;
    const auto answer = [&](double since_s) {
      const double rise = -std::expm1(-since_s / tau_s);
      return is_rate ? since_s - tau_s * rise : rise;
    };
    for (Index i = 0; i < A.rows(); ++i) {
      const double t_s = times_s_[static_cast<std::size_t>(i)], since_s = t_s - times_s_.front();
      A(i, 0) = 1.0;
      A(i, 1) = is_rate ? -std::expm1(-since_s / tau_s) : std::exp(-since_s / tau_s);
      for (std::size_t j = 0; j < changes_.size(); ++j)
        if (t_s > changes_[j].given_s + latency_s)
          A(i, 2 + static_cast<Index>(j)) = answer(t_s - changes_[j].given_s - latency_s);
    }
    // A rate plant continues at the rate of its first command, which is unknown.
    if (is_rate) {
      A.conservativeResize(Eigen::NoChange, A.cols() + 1);
      for (Index i = 0; i < A.rows(); ++i)
        A(i, A.cols() - 1) = times_s_[static_cast<std::size_t>(i)] - times_s_.front();
    }
    return A;
  }
  /// Σ misfit² with a free effect of each command.
  [[nodiscard]] double sum2(const Eigen::MatrixXd& A) const {
    constexpr double ridge = 1e-10;  // for commands without effect within the log
    const Eigen::VectorXd scale = A.colwise().norm().cwiseMax(1e-300).cwiseInverse();
    const Eigen::MatrixXd scaled = A * scale.asDiagonal();
    Eigen::MatrixXd normal = scaled.transpose() * scaled;
    normal.diagonal().array() += ridge;
    return (scaled * solve_symmetric(normal, scaled.transpose() * readings_) - readings_).squaredNorm();
  }
  /// Σ misfit² with a common gain and some commands lost.
  [[nodiscard]] double sum2_without(const Eigen::MatrixXd& A, const std::vector<char>& is_lost) const {
    Eigen::VectorXd jumps = Eigen::VectorXd::Zero(static_cast<Index>(changes_.size()));
    double waits = 0.0;  // the change of lost commands takes effect with the next one that arrives
    for (std::size_t j = 0; j < changes_.size(); ++j) {
      waits += changes_[j].by;
      if (is_lost[j]) continue;
      jumps[static_cast<Index>(j)] = waits;
      waits = 0.0;
    }
    Eigen::MatrixXd own(A.rows(), kind_ == ServoKind::rate ? 4 : 3);
    own.leftCols(2) = A.leftCols(2);
    own.col(2) = A.middleCols(2, jumps.size()) * jumps;
    if (kind_ == ServoKind::rate) own.col(3) = A.col(A.cols() - 1);
    return (own * least_squares(own, readings_) - readings_).squaredNorm();
  }
  [[nodiscard]] const std::vector<CommandChange>& changes() const { return changes_; }
  [[nodiscard]] double first_s() const { return times_s_.front(); }
  [[nodiscard]] double last_s() const { return times_s_.back(); }
  [[nodiscard]] double size() const { return static_cast<double>(times_s_.size()); }

 private:
  ServoKind kind_;
  std::vector<CommandChange> changes_;
  std::vector<double> times_s_;
  Eigen::VectorXd readings_;
};

/// With a free effect of each command, time constant and latency are determined by the shape of the responses alone.
struct FreeFit {
  Eigen::MatrixXd A;
  double sum2 = std::numeric_limits<double>::infinity(), latency_s = 0.0;
};
FreeFit free_fit(const StepResponses& steps, double row_s) {
  std::vector<double> holds_s;
  for (std::size_t j = 1; j < steps.changes().size(); ++j)
    holds_s.push_back(steps.changes()[j].given_s - steps.changes()[j - 1].given_s);
  const double hold_s = median_of(holds_s);
  FreeFit best;
  for (double tau_s = row_s; tau_s < hold_s; tau_s *= 1.3) {
    for (double latency_s = 0.0; latency_s < hold_s; latency_s = std::max(0.5 * row_s, 1.25 * latency_s)) {
      Eigen::MatrixXd A = steps.at(tau_s, latency_s);
      const double sum2 = steps.sum2(A);
      if (sum2 < best.sum2) best = {std::move(A), sum2, latency_s};
    }
  }
  return best;
}

/// Greedy selection: starting with none lost, toggles the command that reduces the sum of squares most, as long as the
/// reduction exceeds that of the best of so many choices by chance.
std::vector<char> lost_of(const StepResponses& steps, const FreeFit& fit) {
  const auto num = steps.changes().size();
  std::vector<char> is_lost(num, 0);
  const double variance = fit.sum2 / (steps.size() - static_cast<double>(num) - 4.0);
  const double price = (12.0 + 2.0 * std::log(static_cast<double>(num))) * variance;
  double cost = steps.sum2_without(fit.A, is_lost);
  for (std::size_t round = 0; round < num; ++round) {
    std::size_t best = num;
    double least = cost;
    for (std::size_t j = 0; j < num; ++j) {
      if (steps.changes()[j].given_s + fit.latency_s >= steps.last_s()) continue;
      is_lost[j] ^= 1;
      const double tried =
          steps.sum2_without(fit.A, is_lost) + price * static_cast<double>(std::ranges::count(is_lost, 1));
      is_lost[j] ^= 1;
      if (tried < least) {
        least = tried;
        best = j;
      }
    }
    if (best == num) break;
    is_lost[best] ^= 1;
    cost = least;
  }
  return is_lost;
}

}  // namespace

std::vector<std::size_t> lost_commands(std::span<const ServoSample> log, ServoKind kind) {
  constexpr std::size_t least = 4, most = 60;  // in a chirp every row has a new command
  const StepResponses steps(log, kind, changes_of(log));
  const std::size_t num = steps.changes().size();
  if (num < least || num > most || 8 * num > reading_times(log).size()) return {};
  const FreeFit fit = free_fit(steps, (steps.last_s() - steps.first_s()) / steps.size());
  if (!(fit.sum2 > 0.0) || !std::isfinite(fit.sum2)) return {};
  const std::vector<char> is_lost = lost_of(steps, fit);
  std::vector<std::size_t> rows;
  for (std::size_t j = 0; j < num; ++j)
    if (is_lost[j]) rows.push_back(steps.changes()[j].row);
  return 3 * rows.size() <= num ? rows : std::vector<std::size_t>();  // most must have been followed
}

double price_of_lost(std::span<const ServoSample> log, std::size_t lost) {
  const auto num = static_cast<double>(changes_of(log).size()), some = static_cast<double>(lost);
  return 2.0 * (std::lgamma(num + 1.0) - std::lgamma(some + 1.0) - std::lgamma(num - some + 1.0));
}

std::optional<ZeroSlip> zero_slip(std::span<const ServoSample> log, const ServoFit& fit) {
  constexpr double least_rows = 4.0, margin = 12.0;
  const FlawGround ground = flaw_ground(log, fit);
  const Index n = ground.misfit.size();
  const Eigen::RowVectorXd left = ground.misfit.transpose() * ground.across;
  Eigen::RowVectorXd after = Eigen::RowVectorXd::Zero(ground.across.cols());
  double sum = 0.0, best2 = 0.0, size_rad = 0.0;
  Index first = 0;
  for (Index k = n - 1; k > 0; --k) {
    after += ground.across.row(k);
    sum += ground.misfit[k];
    const double own2 = static_cast<double>(n - k) - after.squaredNorm();  // projects out the parameters
    if (!(own2 > least_rows)) continue;
    const double along = -(sum - after.dot(left));
    if (!(along * along / own2 > best2)) continue;
    best2 = along * along / own2;
    size_rad = along / own2;
    first = k;
  }
  if (first == 0) return std::nullopt;
  Eigen::VectorXd rest = ground.misfit - ground.across * left.transpose(), step = Eigen::VectorXd::Zero(n);
  step.tail(n - first).setOnes();
  rest += size_rad * (step - ground.across * (ground.across.transpose() * step));
  const double rows = effective_rows(rest), before2 = rest.squaredNorm() + best2;
  if (!(rows * std::log(before2 / rest.squaredNorm()) > margin + 3.0 * std::log(static_cast<double>(n))))
    return std::nullopt;
  std::size_t row = 0;
  for (Index reading = -1; row < log.size(); ++row)
    if (is_reading(log, row) && ++reading == first) break;
  return ZeroSlip{row, log[row].t_s, size_rad, 0.0};
}

Eigen::MatrixXd with_slips(std::span<const ServoSample> log, const std::vector<ZeroSlip>& slips, Eigen::MatrixXd J) {
  for (const ZeroSlip& slip : slips) {
    J.conservativeResize(Eigen::NoChange, J.cols() + 1);
    J.rightCols<1>().setZero();
    Index reading = -1;
    for (std::size_t row = 0; row < log.size(); ++row)
      if (is_reading(log, row) && (++reading, log[row].t_s >= slip.t_s)) J(reading, J.cols() - 1) = 1.0;
  }
  return J;
}

std::vector<ServoSample> without_faults(std::span<const ServoSample> log, const std::vector<std::size_t>& lost,
                                        const std::vector<ZeroSlip>& slips) {
  std::vector<ServoSample> rows(log.begin(), log.end());
  for (const std::size_t row : lost) {
    const double command = log[row].command;
    for (std::size_t i = row; i < rows.size() && log[i].command == command; ++i)
      rows[i].command = rows[row - 1].command;
  }
  for (const ZeroSlip& slip : slips)
    for (ServoSample& row : rows)
      if (row.t_s >= slip.t_s) row.angle_rad -= slip.size_rad;
  return rows;
}

}  // namespace alidade
