#include "alidade/servo/identify/positioner_problem.h"

#include <algorithm>
#include <cmath>

#include "alidade/estimation/median.h"

namespace alidade {
namespace {

constexpr double not_yet = -1e300;

/// Median time for which a reading stays constant while the axis moves by many steps. 0: hardly longer than the request
double renewal_s(const PositionerLog& log, double step_rad) {
  constexpr double long_s = 0.15, times = 3.0, many_steps = 5.0;
  constexpr std::size_t fewest = 3;
  std::vector<double> held_s, asked_s;
  double last_s = not_yet;
  for (std::size_t i = 1; i < log.readings.size(); ++i) {
    const PositionerReading &before = log.readings[i - 1], &now = log.readings[i];
    asked_s.push_back(now.t_s - before.t_s);
    const double change = std::abs(now.angle_rad - before.angle_rad);
    if (change == 0.0) continue;
    if (change > many_steps * step_rad && now.t_s - last_s < 1.0) held_s.push_back(now.t_s - last_s);
    last_s = change > many_steps * step_rad ? now.t_s : not_yet;
  }
  if (held_s.size() < fewest) return 0.0;
  const double held = median_of(std::move(held_s));
  return held > std::max(long_s, times * median_of(std::move(asked_s))) ? held : 0.0;
}

}  // namespace

void heed_renewal(const PositionerLog& log, double step_rad, PositionerFit& fit) {
  constexpr double alone_s = 1.0;
  if (fit.encoder_hz > 0.0) return;
  fit.renewal_s = renewal_s(log, step_rad);
  if (fit.renewal_s == 0.0) return;
  std::vector<double> waits;
  double sum_span2 = 0.0;  // of the durations of moves, whose ends are uncertain
  for (std::size_t k = 0; k < log.commands.size(); ++k) {
    const double from_s = log.commands[k].t_s;
    const double until_s = k + 1 < log.commands.size() ? log.commands[k + 1].t_s : 1e300;
    if (until_s - from_s < alone_s || (k > 0 && from_s - log.commands[k - 1].t_s < alone_s)) continue;
    auto next = std::ranges::upper_bound(log.readings, from_s, {}, &PositionerReading::t_s);
    if (next == log.readings.begin()) continue;
    double before = (next - 1)->angle_rad, first_s = until_s, last_s = from_s;
    for (; next != log.readings.end() && next->t_s < until_s; before = (next++)->angle_rad) {
      if (next->angle_rad == before) continue;
      first_s = std::min(first_s, next->t_s);
      last_s = next->t_s;
    }
    if (last_s == from_s) continue;
    waits.push_back(first_s - from_s);
    sum_span2 += (last_s - first_s) * (last_s - first_s);
  }
  if (waits.size() < 3) return;
  double mean = 0.0, sum2 = 0.0;
  const double n = static_cast<double>(waits.size());
  for (const double each : waits) mean += each / n;
  for (const double each : waits) sum2 += (each - mean) * (each - mean);
  if (sum_span2 > 0.0)
    fit.rate.sigma = std::hypot(fit.rate.sigma, fit.rate.value * fit.renewal_s / std::sqrt(6.0 * sum_span2));
  fit.latency = {mean, std::hypot(std::sqrt(sum2 / (n - 1.0) / n), fit.latency.sigma), true, 0.0};
}

}  // namespace alidade
