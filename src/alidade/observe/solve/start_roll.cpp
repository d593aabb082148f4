#include "alidade/observe/solve/start_roll.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

namespace alidade {

double start_roll(std::span<const RotationFrame> frames) {
  constexpr double far_enough = 0.25 * std::numbers::pi;
  std::complex<double> sum = 0.0;
  const RotationFrame* before = nullptr;
  for (const RotationFrame& frame : frames) {
    if (std::ranges::none_of(frame.px, [](const Eigen::Vector2d& px) { return is_seen(px); })) continue;
    Eigen::Vector2d way_px = Eigen::Vector2d::Zero();
    double count = 0.0;
    for (std::size_t i = 0; before != nullptr && i < std::min(frame.px.size(), before->px.size()); ++i) {
      if (!is_seen(frame.px[i]) || !is_seen(before->px[i])) continue;
      way_px += frame.px[i] - before->px[i];
      count += 1.0;
    }
    if (count > 0.0 && !frame.starts_segment) {
      const Eigen::Vector3d ahead =
          frame.cam_from_start * (before->cam_from_start.conjugate() * Eigen::Vector3d::UnitZ());
      sum += std::conj(std::complex(ahead.x(), ahead.y())) * std::complex(way_px.x() / count, way_px.y() / count);
    }
    before = &frame;
  }
  const double roll = std::arg(sum);
  return std::abs(roll) > far_enough ? roll : 0.0;
}

}  // namespace alidade
