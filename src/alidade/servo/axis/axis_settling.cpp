#include "alidade/servo/axis/axis_settling.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "alidade/servo/axis/axis_controller.h"

namespace alidade {
namespace {

ServoAxis without_ends(const ServoAxis& axis) {
  ServoAxis smooth = axis;
  smooth.dead_band = smooth.backlash_rad = 0.0;
  smooth.min_rad = -std::numeric_limits<double>::infinity();
  smooth.max_rad = std::numeric_limits<double>::infinity();
  return smooth;
}

/// A controller, the axis that it drives, and the delayed errors between them.
class SmallLoop {
 public:
  SmallLoop(const ServoConfig& config, const ServoAxis& known, const ServoAxis& real, double focal_px, double latency_s,
            double offset_rad)
      : period_s_(config.period_s),
        controller_(config, without_ends(known), focal_px),
        axis_(without_ends(real), {offset_rad, 0.0}),
        errors_(1 + static_cast<std::size_t>(std::max(0.0, std::ceil(latency_s / config.period_s - 1e-9))), 0.0) {
    input_.wanted_rad.emplace().setZero();
  }
  /// Simulates one period; returns the offset of the axis.
  double step() {
    std::rotate(errors_.begin(), errors_.end() - 1, errors_.end());
    errors_.front() = -axis_.motion().angle_rad;
    input_.error_rad = errors_.back();
    input_.encoder_rad = axis_.motion().angle_rad;
    axis_.send(controller_.command(input_));
    axis_.advance(period_s_);
    return std::abs(axis_.motion().angle_rad);
  }

 private:
  double period_s_;
  AxisController controller_;
  DelayedAxis axis_;
  AxisInput input_;
  std::vector<double> errors_;  ///< Newest first.
};

}  // namespace

double settling_per_period(const ServoConfig& config, const ServoAxis& known, const ServoAxis& real, double focal_px,
                           double latency_s) {
  constexpr double offset_rad = 1e-6;  // far from all rate limits, even after growing a thousandfold
  constexpr double settled = 1e-4, grown = 1e3;
  constexpr int shortest = 64, num_periods = 10240;
  // The effect of a command shows after one delay, and the reaction to it after another.
  const double late_s = latency_s + std::max(known.command_delay_s, real.command_delay_s);
  const int window = shortest + 2 * static_cast<int>(std::ceil(late_s / config.period_s));
  const int max_windows = std::max(16, num_periods / window);
  SmallLoop loop(config, known, real, focal_px, latency_s, offset_rad);
  std::vector<double> sizes;
  for (int k = 0; k < max_windows; ++k) {
    double size = 0.0;
    for (int i = 0; i < window; ++i) {
      const double off = loop.step();
      if (!std::isfinite(off)) return 10.0;
      size = std::max(size, off);
    }
    sizes.push_back(size);
    if (size < settled * offset_rad || size > grown * offset_rad) break;
  }
  // Over the last half of the windows, so that fast transients do not count.
  const double last = sizes.back();
  if (sizes.size() == 1) return std::pow(last / offset_rad, 1.0 / window);
  const std::size_t from = (sizes.size() - 1) / 2;
  return std::pow(last / sizes[from], 1.0 / (window * static_cast<double>(sizes.size() - 1 - from)));
}

}  // namespace alidade
