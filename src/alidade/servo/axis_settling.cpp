#include "alidade/servo/axis_settling.h"

#include <algorithm>
#include <cmath>

#include "alidade/servo/axis_controller.h"

namespace alidade {

double settling_per_period(const ServoConfig& config, const ServoAxis& known, const ServoAxis& real, double focal_px) {
  constexpr double offset_rad = 1e-3;  // far from every limit of rate
  constexpr int quarter = 100;
  AxisController controller(config, known, focal_px);
  DelayedAxis axis(real, {offset_rad, 0.0});
  AxisInput input;
  input.wanted_rad.emplace().setZero();
  double second = 0.0, last = 0.0;
  for (int k = 0; k < 4 * quarter; ++k) {
    input.encoder_rad = axis.motion().angle_rad;
    axis.send(controller.command(input));
    axis.advance(config.period_s);
    const double off = std::abs(axis.motion().angle_rad);
    if (!std::isfinite(off)) return 10.0;
    if (k >= quarter && k < 2 * quarter) second = std::max(second, off);
    if (k >= 3 * quarter) last = std::max(last, off);
  }
  constexpr double settled_rad = 1e-9;
  if (last < settled_rad) return 0.5;  // it has long settled: how fast is not told
  const double per_period = std::pow(last / std::max(second, settled_rad), 1.0 / (2.0 * quarter));
  return last > 0.5 * offset_rad ? std::max(1.0, per_period) : per_period;
}

}  // namespace alidade
