#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "alidade/localize/checks/depth_fit.h"
#include "alidade/localize/checks/scale_readings.h"

// A depth sensor's scale: its clock, its filter, a jump or drift of its offset, and its position in the camera frame.

namespace alidade {
namespace {

constexpr double never_s = std::numeric_limits<double>::infinity();

/// Mean squared residual, in σ².
double misfit_of(const DepthModel& model, std::vector<DepthRow> rows) {
  if (!fitted_without_far(model, rows)) return std::numeric_limits<double>::infinity();
  double squares = 0.0;
  for (const DepthRow& row : rows) squares += row.left * row.left;
  return squares / static_cast<double>(rows.size());
}

/// Delay of the readings' clock, if it explains significantly more than none: the minimum of a parabola through the
/// best of a grid.
double clock_of(const DepthModel& model, const SensorPath& path) {
  constexpr double step_s = 0.05, clear = 12.0;  // of χ², 3.5σ
  constexpr int most = 20;
  std::array<double, 2 * most + 1> misfits{};
  for (int i = -most; i <= most; ++i)
    misfits[static_cast<std::size_t>(i + most)] = misfit_of(model, rows_at(model, step_s * i, path));
  const auto best = static_cast<std::size_t>(std::ranges::min_element(misfits) - misfits.begin());
  std::vector<DepthRow> rows = rows_at(model, step_s * (static_cast<double>(best) - most), path);
  if (best == 0 || best + 1 == misfits.size() || !std::isfinite(misfits[best - 1] + misfits[best + 1]) ||
      !fitted_without_far(model, rows))
    return 0.0;
  const double unit = std::max(1.0, misfits[best]) * inflation(rows) / static_cast<double>(rows.size());
  if (!(misfits[most] - misfits[best] > clear * unit)) return 0.0;
  const double curve = misfits[best - 1] - 2.0 * misfits[best] + misfits[best + 1];
  const double share = curve > 0.0 ? 0.5 * (misfits[best - 1] - misfits[best + 1]) / curve : 0.0;
  return step_s * (static_cast<double>(best) - most + std::clamp(share, -1.0, 1.0));
}

/// Time constant and clock of a sensor.
struct Follows {
  double tau_s = 0.0, late_s = 0.0, misfit = std::numeric_limits<double>::infinity();
  double rival_tau_s = 0.0, rival_late_s = 0.0;  ///< A filter of doubtful significance.
};

/// A low-pass filter delays its input by its time constant, as a late clock does, and attenuates it, as no clock does.
/// Returns the one with the least misfit, if it explains significantly more than the clock alone. Skipped if the clock
/// is right and residuals are not autocorrelated.
Follows follows(const DepthModel& model, double late_s, const SensorPath& path) {
  constexpr double first_s = 0.05, last_s = 2.0, ratio = 1.1, step_s = 0.05, clear = 12.0, half_clear = 4.0,
                   alike = 3.0;
  constexpr int most = 2;  // beside a filter, the clock is nearly right
  std::vector<DepthRow> rows = rows_at(model, late_s, path);
  const std::size_t num_given = rows.size();
  Follows best{.late_s = late_s, .misfit = misfit_of(model, rows)};
  const Follows clock = best;
  if (!fitted_without_far(model, rows) || (late_s == 0.0 && inflation(rows) < alike)) return clock;
  for (double tau_s = first_s; tau_s < last_s; tau_s *= ratio) {
    const SensorPath shown = path.filtered(tau_s);
    if (2 * rows_at(model, 0.0, shown).size() < num_given) break;  // so few readings would fit anything
    for (int k = -most; k <= most; ++k) {
      const double late = k * step_s;
      const double misfit = misfit_of(model, rows_at(model, late, shown));
      if (misfit < best.misfit) best = {.tau_s = tau_s, .late_s = late, .misfit = misfit};
    }
  }
  if (best.tau_s == 0.0) return clock;
  std::vector<DepthRow> explained = rows_at(model, best.late_s, path.filtered(best.tau_s));
  if (!fitted_without_far(model, explained)) return clock;
  const double unit = best.misfit * inflation(explained) / static_cast<double>(explained.size());
  const double gain = (clock.misfit - best.misfit) / unit;
  if (gain > clear) return best;
  Follows doubtful = clock;
  if (gain > half_clear) doubtful.rival_tau_s = best.tau_s, doubtful.rival_late_s = best.late_s;
  return doubtful;
}

/// Time from which readings have another offset, as when a sensor is zeroed or moved on its vehicle: if that explains
/// significantly more than nothing, a clock or a filter (5.5σ at one of a hundred times), and leaves no
/// autocorrelation, as a tide would. Without it the rest of the path would move vertically by the jump, and the
/// residuals look like a filter. Skipped if residuals are not autocorrelated.
double jump_of(const DepthModel& model, const SensorPath& path) {
  constexpr double clear = 30.0, alike = 3.0, few = 0.05;
  constexpr std::size_t ends = 5, most = 100;
  const std::vector<DepthRow> rows = rows_at(model, 0.0, path);
  const DepthCost without = cost_of(model, rows);
  std::vector<double> t_s;
  for (const DepthReading& reading : model.readings)
    if (path.at(reading.t_s)) t_s.push_back(reading.t_s);
  if (t_s.size() < 4 * ends || (without.alike < alike && without.rejected < few)) return never_s;
  std::size_t best = 0;
  DepthCost least;
  std::vector<DepthRow> jumping = rows;
  const auto look = [&](std::size_t from, std::size_t to, std::size_t stride) {
    for (std::size_t k = std::max(from, ends); k <= std::min(to, t_s.size() - ends); k += stride) {
      const double jump_s = 0.5 * (t_s[k - 1] + t_s[k]);
      for (std::size_t i = 0; i < t_s.size(); ++i) jumping[i].after_jump = t_s[i] > jump_s ? 1.0 : 0.0;
      const DepthCost at = cost_of(model, jumping);
      if (at.cost < least.cost) least = at, best = k;
    }
  };
  const std::size_t stride = std::max(t_s.size() / most, std::size_t{1});
  look(ends, t_s.size() - ends, stride);
  if (stride > 1 && best > 0) look(best - stride + 1, best + stride - 1, std::max(stride / 10, std::size_t{1}));
  const auto is_worse = [&](const std::vector<DepthRow>& other) {
    return cost_of(model, other, least.limit).cost - least.cost > clear * least.unit;
  };
  if (best == 0 || !(least.alike < alike) || !is_worse(rows)) return never_s;
  const Follows other = follows(model, clock_of(model, path), path);
  const auto shown = other.tau_s > 0.0 ? path.filtered(other.tau_s) : path;
  return is_worse(rows_at(model, other.late_s, shown)) ? 0.5 * (t_s[best - 1] + t_s[best]) : never_s;
}

/// A hypothesis about the readings, and its fit.
struct Account {
  DepthModel model;
  Follows found;
  std::vector<DepthRow> rows;  ///< All.
  DepthCost cost;
};

std::vector<DepthRow> rows_by(const DepthModel& model, const Follows& found, const SensorPath& path) {
  return rows_at(model, found.late_s, found.tau_s > 0.0 ? path.filtered(found.tau_s) : path);
}

Account account_of(DepthModel model, const Follows& found, const SensorPath& path) {
  Account account{std::move(model), found, {}, {}};
  account.rows = rows_by(account.model, found, path);
  account.cost = cost_of(account.model, account.rows);
  return account;
}

/// The best jump, clock and filter for that model.
Account searched(DepthModel model, const SensorPath& path) {
  model.jump_s = jump_of(model, path);
  const Follows found = follows(model, clock_of(model, path), path);
  return account_of(std::move(model), found, path);
}

/// Decrease of χ² by one hypothesis relative to another.
double gain(const Account& of, const Account& over) {
  if (!std::isfinite(of.cost.cost)) return 0.0;
  const DepthCost other = cost_of(over.model, over.rows, of.cost.limit);
  return (other.cost - of.cost.cost) / of.cost.unit;
}

DepthModel with_drift(DepthModel model, int num) {
  model.num_drift = num;
  return model;
}

DepthModel with_arm(const DepthModel& model, const Follows& found, const SensorPath& path) {
  DepthModel with = model;
  with.sigma_arm_m = 1.0;  // so that the rows contain the axes
  const std::vector<DepthRow> rows = rows_by(with, found, path);
  return with_free_arm(std::move(with), rows);
}

constexpr double clear_gain = 30.0;

/// The best significant extension of a hypothesis: another position of the sensor, or a drift. Only extensions that
/// improve the fit with the current clock and filter, or without these, are searched with others. A drift gets more
/// pieces if that is significant as well.
std::optional<Account> better(const Account& base, const SensorPath& path) {
  constexpr double worth_it = 12.0;
  const auto looked_at = [&](const DepthModel& model) -> std::optional<Account> {
    DepthModel free = model;
    free.jump_s = never_s;
    Account one = account_of(model, base.found, path), alone = account_of(free, Follows{}, path);
    if (alone.cost.cost < one.cost.cost) one = std::move(alone);
    if (std::isfinite(base.cost.cost) && !(gain(one, base) > worth_it)) return std::nullopt;
    Account full = searched(std::move(free), path);
    if (full.cost.cost < one.cost.cost) one = std::move(full);
    return gain(one, base) > clear_gain ? std::optional(std::move(one)) : std::nullopt;
  };
  std::optional<Account> best;
  if (!base.model.is_arm_free) {
    best = looked_at(with_arm(base.model, base.found, path));
    if (auto alone = looked_at(with_arm(base.model, Follows{}, path));
        alone && (!best || alone->cost.cost < best->cost.cost))
      best = std::move(alone);
  }
  std::optional<Account> drifting;
  for (const int num : {1, DepthModel::most_drift}) {
    if (num <= base.model.num_drift) continue;
    auto one = looked_at(with_drift(base.model, num));
    if (one && (!drifting || gain(*one, *drifting) > clear_gain)) drifting = std::move(one);
  }
  if (drifting && (!best || drifting->cost.cost < best->cost.cost)) best = std::move(drifting);
  return best;
}

/// ln of the scale from `rows`, which may contain outliers. Empty: no fit.
std::optional<double> log_scale(const DepthModel& model, std::vector<DepthRow> rows) {
  const auto fit = fitted_without_far(model, rows);
  return fit && fit->g().norm() > 0.0 ? std::optional(std::log(fit->g().norm())) : std::nullopt;
}

/// Uncertainty of ln scale by a filter or an arm of doubtful significance.
double doubt_of(const Account& account, double log, const SensorPath& path) {
  constexpr double half_believed = 16.0;  // p ≈ 0.001 for three parameters
  double doubt = 0.0;
  const auto add = [&](const std::optional<double>& other) {
    if (other) doubt = std::hypot(doubt, *other - log);
  };
  const Follows& found = account.found;
  if (found.rival_tau_s > 0.0)
    add(log_scale(account.model, rows_at(account.model, found.rival_late_s, path.filtered(found.rival_tau_s))));
  if (account.model.is_arm_free) return doubt;
  const Account with = account_of(with_arm(account.model, found, path), found, path);
  if (gain(with, account) > half_believed) add(log_scale(with.model, with.rows));
  return doubt;
}

/// Change of ln scale if an arm without given σ is 1 cm off.
double arm_effect(const Account& account, double log, const SensorPath& path) {
  constexpr double ordinary_m = 0.01;
  if (account.model.sigma_arm_m) return 0.0;
  double squares = 0.0;
  for (int i = 0; i < 3; ++i) {
    DepthModel other = account.model;
    other.arm_m[i] += ordinary_m;
    other.g.reset();
    const auto moved = log_scale(other, rows_by(other, account.found, path));
    if (moved) squares += (*moved - log) * (*moved - log);
  }
  return std::sqrt(squares);
}

/// Copies the other estimated effects.
void take_found(const Account& account, const DepthFit& fit, double worse, ReadScale& read) {
  const DepthModel& model = account.model;
  read.late_s = account.found.late_s;
  read.lag_s = account.found.tau_s;
  if (std::isfinite(model.jump_s)) read.jump_m = fit.values[4], read.jump_s = model.jump_s;
  read.drift_m = fit.values.segment(5, model.num_drift).sum();
  read.is_drifting = model.num_drift > 0;
  if (!model.is_arm_free) return;
  read.arm_m = fit.arm_m;
  read.sigma_arm_m = (worse * fit.cov.diagonal().tail<3>()).cwiseSqrt();
}

}  // namespace

std::optional<ReadScale> scale_by_depth(std::span<const DepthReading> readings, double sigma_rel,
                                        std::span<const PathStep> given_path, const DepthArm& arm) {
  const SensorPath path(without_jitter(given_path, jitter_s));
  DepthModel model{.readings = readings, .arm_m = arm.in_cam_m, .sigma_arm_m = arm.sigma_m};
  Account account = searched(model, path);
  for (auto next = better(account, path); next; next = better(account, path)) account = *std::move(next);
  std::vector<DepthRow> rows = account.rows;
  const auto fit = fitted_without_far(account.model, rows);
  if (!fit) return std::nullopt;
  const Eigen::Vector3d g = fit->g();
  double squares = 0.0;
  for (const DepthRow& row : rows) squares += row.left * row.left;
  const double free = static_cast<double>(rows.size()) - account.model.dim();
  const double worse = std::max(1.0, squares / free) * inflation(rows);
  const Eigen::Matrix3d cov = worse * fit->cov.topLeftCorner<3, 3>();
  ReadScale read{.scale = g.norm(), .num_used = rows.size(), .num_rejected = account.rows.size() - rows.size()};
  if (!(read.scale > 0.0)) return std::nullopt;
  take_found(account, *fit, worse, read);
  const Eigen::Vector3d along = g / read.scale;
  const double variance = along.dot(cov * along), across = cov.trace() - variance, log = std::log(read.scale);
  // |g| is biased upwards by the variance across it.
  read.sigma_rel = std::hypot(std::sqrt(variance) / read.scale, 0.5 * across / (read.scale * read.scale), sigma_rel);
  read.sigma_rel = std::hypot(read.sigma_rel, doubt_of(account, log, path));
  read.noise_factor = std::sqrt(squares / free);
  read.arm_effect = arm_effect(account, log, path);
  constexpr double useless = 0.2, misfit = 0.5;
  const auto num_given = static_cast<double>(account.rows.size());
  if (!(read.sigma_rel < useless) || static_cast<double>(rows.size()) < misfit * num_given) return std::nullopt;
  return read;
}

}  // namespace alidade
