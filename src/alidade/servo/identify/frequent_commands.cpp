#include "alidade/servo/identify/frequent_commands.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "alidade/servo/identify/identify_flaws.h"
#include "alidade/servo/identify/log_times.h"
#include "alidade/servo/identify/sampled_log.h"

namespace alidade {
namespace {

constexpr std::array<std::size_t, 7> hypotheses{0, 1, 2, 3, 4, 6, continuous_commands};

/// Slope of the polynomial through a row and its neighbours, two on each side if rows are regular; zero if the command
/// is constant before or after it.
double slope_at(std::span<const ServoSample> log, std::size_t i) {
  constexpr double same = 0.01;
  if (i == 0 || i + 1 == log.size()) return 0.0;
  const double before_s = log[i].t_s - log[i - 1].t_s, after_s = log[i + 1].t_s - log[i].t_s;
  const double before = (log[i].command - log[i - 1].command) / before_s;
  const double after = (log[i + 1].command - log[i].command) / after_s;
  if (before == 0.0 || after == 0.0) return 0.0;
  const auto is_regular = [&](std::size_t k) {
    return std::abs(log[k].t_s - log[k - 1].t_s - after_s) < same * after_s;
  };
  if (i > 1 && i + 2 < log.size() && is_regular(i - 1) && is_regular(i) && is_regular(i + 2)) {
    const double far = log[i + 2].command - log[i - 2].command, near = log[i + 1].command - log[i - 1].command;
    return (8.0 * near - far) / (12.0 * after_s);
  }
  return (after_s * before + before_s * after) / (before_s + after_s);
}

/// Cubic Hermite interpolation between a row and the next.
double command_between(std::span<const ServoSample> log, std::size_t i, double share) {
  const double dt_s = log[i + 1].t_s - log[i].t_s, s = share, r = 1.0 - share;
  return r * r * (1.0 + 2.0 * s) * log[i].command + s * s * (1.0 + 2.0 * r) * log[i + 1].command +
         s * r * dt_s * (r * slope_at(log, i) - s * slope_at(log, i + 1));
}

/// Mean delay, in rows, of commands given between rows if a log is taken to have them at its rows.
double late_rows(std::size_t per_row) { return per_row == 0 ? 0.0 : 0.5 * (1.0 - 1.0 / static_cast<double>(per_row)); }

/// The fit of the log with `per_row` commands, and Σ misfit².
struct Hypothesis {
  std::size_t per_row = 0;
  ServoFit fit;
  double sum2 = std::numeric_limits<double>::infinity(), rows = 0.0;
};
Hypothesis fitted(std::span<const ServoSample> log, const ServoFit& fit, std::size_t fitted_per_row,
                  std::size_t per_row) {
  constexpr int max_steps = 12;
  const std::vector<ServoSample> finer = with_commands_between(log, per_row);
  ServoFit start = fit;
  double& latency_s = start.params[ServoParam::latency];
  latency_s = std::max(0.0, latency_s + usual_spacing(log) * (late_rows(per_row) - late_rows(fitted_per_row)));
  Hypothesis trial{per_row, start};
  if (fit.freed.empty())
    trial.fit = refined(finer, fit.kind, start.params);
  else
    refine_flawed(finer, max_steps, trial.fit);
  const Eigen::VectorXd misfit = trial.fit.freed.empty()
                                     ? servo_response(finer, fit.kind, trial.fit.params).angle_rad - readings_of(finer)
                                     : flawed_misfit(finer, trial.fit);
  trial.sum2 = std::max(misfit.squaredNorm(), std::numeric_limits<double>::min());
  trial.rows = effective_rows(misfit);
  return trial;
}

std::vector<Hypothesis> all_fitted(std::span<const ServoSample> log, const ServoFit& fit, std::size_t fitted_per_row) {
  constexpr double lost = 1.5;
  const double spacing_s = usual_spacing(log);
  bool has_gaps = false;
  for (std::size_t i = 1; i < log.size(); ++i) has_gaps |= log[i].t_s - log[i - 1].t_s > lost * spacing_s;
  std::vector<Hypothesis> all;
  for (const std::size_t per_row : hypotheses)
    if (per_row != 1 || has_gaps) all.push_back(fitted(log, fit, fitted_per_row, per_row));
  return all;
}

}  // namespace

bool has_frequent_commands(std::span<const ServoSample> log) {
  constexpr std::size_t least = 20;
  std::size_t changes = 0, again = 0;
  bool did_change = false;
  for (std::size_t i = 1; i < log.size(); ++i) {
    if (std::isfinite(log[i].command_t_s)) return false;
    const bool changes_now = log[i].command != log[i - 1].command;
    changes += changes_now ? 1 : 0;
    again += changes_now && did_change ? 1 : 0;
    did_change = changes_now;
  }
  return again >= least && 2 * again >= changes;
}

std::vector<ServoSample> with_commands_between(std::span<const ServoSample> log, std::size_t per_row) {
  constexpr double steps_of_all_the_time = 8.0;
  std::vector<ServoSample> rows;
  if (per_row == 0) return {log.begin(), log.end()};
  const bool is_continuous = per_row == continuous_commands;
  const double step_s = usual_spacing(log) / (is_continuous ? steps_of_all_the_time : static_cast<double>(per_row));
  for (std::size_t i = 0; i < log.size(); ++i) {
    const double gap_s = i + 1 < log.size() ? log[i + 1].t_s - log[i].t_s : 0.0;
    const double num = std::clamp(std::round(gap_s / step_s), 1.0, 100.0);  // limited for a pause
    for (double k = 0.0; k < num; ++k) {
      ServoSample row = log[i];
      row.t_s += k / num * gap_s;
      if (k > 0.0) row.command = command_between(log, i, k / num);
      if (k > 0.0) row.sampled_t_s = log[i].read_s();
      if (is_continuous)
        row.command_t_s = row.t_s - 0.5 * gap_s / num;  // the centre of the interval that it represents
      rows.push_back(row);
    }
  }
  return rows;
}

std::size_t commands_per_row(std::span<const ServoSample> log, const ServoFit& fit) {
  constexpr double clear = 12.0;
  const std::vector<Hypothesis> all = all_fitted(log, fit, 0);
  const Hypothesis& best = *std::ranges::min_element(all, {}, &Hypothesis::sum2);
  return best.rows * std::log(all.front().sum2 / best.sum2) > clear ? best.per_row : 0;
}

decltype(ServoFit::cov) cov_of_commands_between(std::span<const ServoSample> log, const ServoFit& fit,
                                                std::size_t per_row) {
  const std::vector<Hypothesis> all = all_fitted(log, fit, per_row);
  const Hypothesis& best = *std::ranges::min_element(all, {}, &Hypothesis::sum2);
  decltype(ServoFit::cov) sum = decltype(sum)::Zero();
  double weights = 0.0;
  for (const Hypothesis& each : all) {
    const double weight = std::exp(-0.5 * best.rows * std::log(each.sum2 / best.sum2));
    const ServoParams by = each.fit.params - fit.params;
    sum += weight * by * by.transpose();
    weights += weight;
  }
  return sum / weights;
}

double max_sigma_command_s(const ServoFit& fit) {
  constexpr double of_latency = 0.2, of_time_constant = 0.05;
  return std::max(of_latency * fit.params[ServoParam::latency], of_time_constant * fit.params[ServoParam::tau]);
}

}  // namespace alidade
