#include "alidade/servo/identify/identify_causes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "alidade/servo/identify/identify_flaws.h"
#include "alidade/servo/identify/sampled_log.h"

namespace alidade {
namespace {

using Eigen::Index;

/// The log from a row on; it also contains earlier commands that may not have taken effect yet.
std::vector<ServoSample> part_from(std::span<const ServoSample> log, std::size_t row, double waiting_s) {
  const double from_s = log[row].t_s - waiting_s;
  const auto first =
      static_cast<std::size_t>(std::ranges::lower_bound(log, from_s, {}, &ServoSample::t_s) - log.begin());
  std::vector<ServoSample> part(log.begin() + static_cast<std::ptrdiff_t>(first), log.end());
  for (std::size_t i = 0; i < part.size(); ++i) {
    const bool is_before = first + i < row;
    part[i].sampled_t_s = is_before ? log[row].t_s : part[i].t_s;  // repeats one reading
    if (is_before) part[i].angle_rad = log[row].angle_rad;
  }
  return part;
}

struct Parts {
  std::size_t row = 0;
  ServoFit before, after;
  Eigen::VectorXd misfit;
  double sum2 = std::numeric_limits<double>::infinity();
};

Parts parts_at(std::span<const ServoSample> log, const ServoFit& whole, std::size_t row) {
  constexpr double longest_latencies = 3.0, least_s = 0.1;
  const std::vector<ServoSample> later =
      part_from(log, row, longest_latencies * whole.params[ServoParam::latency] + least_s);
  const std::span<const ServoSample> sooner = log.first(row);
  Parts parts{row, refined(sooner, whole.kind, whole.params), refined(later, whole.kind, whole.params), {}};
  const Eigen::VectorXd first = servo_response(sooner, whole.kind, parts.before.params).angle_rad - readings_of(sooner);
  const Eigen::VectorXd second = servo_response(later, whole.kind, parts.after.params).angle_rad - readings_of(later);
  parts.misfit.resize(first.size() + second.size());
  parts.misfit << first, second;
  parts.sum2 = parts.misfit.squaredNorm();
  return parts;
}

/// The split with the smallest residuals: from a grid, then refined between its points.
Parts best_parts(std::span<const ServoSample> log, const ServoFit& whole) {
  constexpr std::array<double, 7> shares{0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8};
  const auto rows = static_cast<double>(log.size());
  Parts best;
  const auto offer = [&](double share) {
    const auto row = static_cast<std::size_t>(std::clamp(share, 0.15, 0.85) * rows);
    Parts parts = parts_at(log, whole, row);
    if (parts.sum2 < best.sum2) best = std::move(parts);
  };
  for (const double share : shares) offer(share);
  for (double step = 0.05; step * rows > 2.0; step *= 0.5) {
    const double middle = static_cast<double>(best.row) / rows;
    offer(middle - step);
    offer(middle + step);
  }
  return best;
}

bool differs(const ServoChange& change, int param) {
  constexpr double clear = 5.0;
  const double apart = change.after.params[param] - change.before.params[param];
  return std::abs(apart) > clear * std::sqrt(change.before.cov(param, param) + change.after.cov(param, param));
}

}  // namespace

std::optional<ServoChange> servo_change(std::span<const ServoSample> log, const ServoFit& believed) {
  constexpr std::size_t least_rows = 200;
  constexpr double max_correlation = 0.3, margin = 12.0, more = num_servo_params + 1.0;  // and the time of the change
  const bool is_held = std::ranges::any_of(log, [](const ServoSample& row) { return std::isfinite(row.sampled_t_s); });
  if (is_held || log.size() < least_rows) return std::nullopt;
  const ServoFit whole = refined(log, believed.kind, searched(log, believed.kind).params);
  const Parts parts = best_parts(log, whole);
  if (std::abs(lag_one_correlation(parts.misfit)) > max_correlation) return std::nullopt;
  const double rows = effective_rows(parts.misfit);
  const double price = (more - static_cast<double>(believed.freed.size())) * std::log(rows) + margin;
  if (!(rows * std::log(flawed_misfit(log, believed).squaredNorm() / parts.sum2) > price)) return std::nullopt;
  ServoChange change{log[parts.row].t_s, whole, parts.before, parts.after};
  const bool is_one =
      differs(change, ServoParam::gain) || differs(change, ServoParam::tau) || differs(change, ServoParam::latency);
  if (!is_one) return std::nullopt;
  return change;
}

std::string change_text(const ServoChange& change) {
  struct Named {
    int param;
    const char *name, *unit;
    double factor;
  };
  constexpr std::array<Named, 3> all{{{ServoParam::tau, "time constant", "ms", 1e3},
                                      {ServoParam::latency, "latency", "ms", 1e3},
                                      {ServoParam::gain, "gain", "rad per unit", 1.0}}};
  std::string text;
  for (const auto& [param, name, unit, factor] : all)
    if (differs(change, param))
      text += (text.empty() ? "the " : ", the ") + std::string(name) + " from " +
              text_of(factor * change.before.params[param]) + " to " + text_of(factor * change.after.params[param]) +
              " " + unit;
  return text;
}

}  // namespace alidade
