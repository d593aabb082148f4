#include "alidade/observe/filters/frame_variation.h"

#include <algorithm>
#include <cmath>

namespace alidade {

FocalVariation focal_variation_of(const RotationBundle& bundle, const BundleSolution& solution) {
  struct Sums {
    double along = 0.0, length = 0.0, squares = 0.0;
    int num = 0;
  };
  std::vector<Sums> frames(bundle.frames.size());
  const Eigen::Vector2d centre = solution.camera.k.tail<2>();
  for (std::size_t i = 0; i < bundle.observations.size(); ++i) {
    const BundleObservation& seen = bundle.observations[i];
    const Eigen::Vector2d& residual = solution.residuals[i];
    if (!residual.allFinite()) continue;
    Sums& sums = frames[static_cast<std::size_t>(seen.frame)];
    const Eigen::Vector2d direction = seen.px - centre;
    sums.along += residual.dot(direction);
    sums.length += direction.squaredNorm();
    sums.squares += residual.squaredNorm();
    ++sums.num;
  }
  double explained = 0.0, all = 0.0;
  int num_frames = 0;
  for (const Sums& sums : frames) {
    all += sums.squares;
    if (sums.num < 2 || !(sums.length > 0.0)) continue;
    explained += sums.along * sums.along / sums.length;
    ++num_frames;
  }
  const int left = solution.dof - num_frames;
  if (num_frames < 5 || left < 5 || !(all > explained)) return {};
  return {explained / all, (explained / num_frames) / std::max((all - explained) / left, 1e-30)};
}

namespace {

/// Sums over the residuals of one frame.
struct FrameSums {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double squares = 0.0;
  int num = 0;
};

std::vector<FrameSums> sums_by_frame(const Adjustment& reference) {
  std::vector<FrameSums> frames(reference.bundle.frames.size());
  for (std::size_t i = 0; i < reference.bundle.observations.size(); ++i) {
    const Eigen::Vector2d& residual = reference.solution.residuals[i];
    if (!residual.allFinite()) continue;
    FrameSums& sums = frames[static_cast<std::size_t>(reference.bundle.observations[i].frame)];
    sums.sum += residual;
    sums.squares += residual.squaredNorm();
    ++sums.num;
  }
  constexpr int min_points = 4;
  std::erase_if(frames, [](const FrameSums& sums) { return sums.num < min_points; });
  return frames;
}

}  // namespace

RotationJitter rotation_jitter(const Adjustment& reference) {
  const std::vector<FrameSums> frames = sums_by_frame(reference);
  double explained = 0.0, left = 0.0, left_dof = 0.0, points = 0.0, to_next = 0.0, squares = 0.0;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    const Eigen::Vector2d mean = frames[k].sum / frames[k].num;
    explained += frames[k].num * mean.squaredNorm();
    left += frames[k].squares - frames[k].num * mean.squaredNorm();
    left_dof += 2.0 * (frames[k].num - 1);
    points += frames[k].num;
    squares += mean.squaredNorm();
    if (k > 0) to_next += mean.dot(frames[k - 1].sum / frames[k - 1].num);
  }
  constexpr std::size_t min_frames = 20;
  if (frames.size() < min_frames || !(left > 0.0)) return {};
  const double num_frames = static_cast<double>(frames.size()), noise = left / left_dof;
  const double ratio = explained / (2.0 * num_frames) / noise;
  const double focal = reference.solution.camera.k.head<2>().mean();
  const double variance = std::max(ratio - 1.0, 0.0) * noise * num_frames / points / (focal * focal);
  return {ratio, variance, std::sqrt(noise), squares > 0.0 ? to_next / squares : 0.0};
}

}  // namespace alidade
