#include <algorithm>
#include <cmath>

#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/observe/solve/solve.h"

namespace alidade {
namespace {

struct RayPair {
  Eigen::Vector3d before, now;
};

/// Rays of the points seen in both rows, for an assumed focal length.
std::vector<RayPair> shared_rays(const RotationRow& before, const RotationRow& now, const PixelScale& scale,
                                 double focal) {
  std::vector<RayPair> pairs;
  const auto ray = [&](const Eigen::Vector2d& px) {
    const Eigen::Vector2d q = scale.normalised(px) / focal;
    return Eigen::Vector3d(q.x(), q.y(), 1.0).normalized();
  };
  for (std::size_t i = 0; i < now.px.size(); ++i) {
    if (is_seen(before.px[i]) && is_seen(now.px[i])) pairs.push_back({ray(before.px[i]), ray(now.px[i])});
  }
  return pairs;
}

/// Weighted rotation that maps the rays `before` to `now`.
Eigen::Matrix3d align(const std::vector<RayPair>& pairs, const std::vector<double>& weights) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < pairs.size(); ++i) sum += weights[i] * pairs[i].now * pairs[i].before.transpose();
  return nearest_rotation(sum);
}

struct Alignment {
  Eigen::Matrix3d cam_from_before = Eigen::Matrix3d::Identity();
  double median_angle = 0.0;
};

/// Robust: least median over pairs of correspondences, then iterative reweighting by the residuals.
Alignment robust_alignment(const std::vector<RayPair>& pairs) {
  std::vector<double> angles(pairs.size()), weights(pairs.size(), 1.0);
  const auto measure = [&](const Eigen::Matrix3d& cam_from_before) {
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      angles[i] = (cam_from_before * pairs[i].before - pairs[i].now).norm();
    }
    return median_of(angles);
  };
  Alignment best{align(pairs, weights), 0.0};
  best.median_angle = measure(best.cam_from_before);
  const std::size_t n = pairs.size();
  for (std::size_t a = 0; a < std::min<std::size_t>(n, 40); ++a) {
    const std::size_t i = a * n / std::min<std::size_t>(n, 40), j = (i + n / 2) % n;
    if (i == j) continue;
    const std::vector<RayPair> two{pairs[i], pairs[j]};
    const Eigen::Matrix3d trial = align(two, {1.0, 1.0});
    const double median = measure(trial);
    if (median < best.median_angle) best = {trial, median};
  }
  for (int round = 0; round < 10; ++round) {
    const double width = 2.0 * std::max(measure(best.cam_from_before), 1e-9);
    for (std::size_t i = 0; i < n; ++i) weights[i] = 1.0 / std::pow(1.0 + std::pow(angles[i] / width, 2), 2);
    best.cam_from_before = align(pairs, weights);
  }
  best.median_angle = measure(best.cam_from_before);
  return best;
}

/// For each row, the earlier one with which it shares most points; −1: none.
std::vector<int> neighbours(const RotationLog& log) {
  std::vector<int> neighbour(log.rows.size(), -1);
  for (std::size_t k = 1; k < log.rows.size(); ++k) {
    std::size_t most = 2;  // at least three points
    for (std::size_t back = 1; back <= std::min<std::size_t>(k, 10); ++back) {
      std::size_t shared = 0;
      for (std::size_t i = 0; i < log.num_points; ++i) {
        shared += is_seen(log.rows[k].px[i]) && is_seen(log.rows[k - back].px[i]);
      }
      if (shared <= most) continue;
      most = shared;
      neighbour[k] = static_cast<int>(k - back);
    }
  }
  return neighbour;
}

}  // namespace

std::optional<FreeRotationStart> free_rotation_start(const RotationLog& log, const PixelScale& scale) {
  const std::vector<int> neighbour = neighbours(log);
  FreeRotationStart best;
  double least = std::numeric_limits<double>::infinity();
  // For long logs, the focal length is estimated from some of the pairs, the rotations from all.
  const std::size_t stride = std::max<std::size_t>(1, log.rows.size() / 30);
  for (double focal = 0.4; focal < 20.0; focal *= 1.07) {
    double sum = 0.0;
    int count = 0;
    for (std::size_t k = 1; k < log.rows.size(); k += stride) {
      if (neighbour[k] < 0) continue;
      const auto pairs = shared_rays(log.rows[static_cast<std::size_t>(neighbour[k])], log.rows[k], scale, focal);
      sum += focal * robust_alignment(pairs).median_angle;  // in pixels, so that a long focal length has no advantage
      ++count;
    }
    if (count == 0) return std::nullopt;
    if (!(sum / count < least)) continue;
    least = sum / count;
    best.focal = focal;
  }
  best.cam_from_start.assign(log.rows.size(), Eigen::Quaterniond::Identity());
  for (std::size_t k = 1; k < log.rows.size(); ++k) {
    if (neighbour[k] < 0) return std::nullopt;
    const auto from = static_cast<std::size_t>(neighbour[k]);
    const auto pairs = shared_rays(log.rows[from], log.rows[k], scale, best.focal);
    const Eigen::Quaterniond cam_from_before(robust_alignment(pairs).cam_from_before);
    const Eigen::Quaterniond& before_from_start = best.cam_from_start[from];
    best.cam_from_start[k] = (cam_from_before * before_from_start).normalized();
  }
  return best;
}

}  // namespace alidade
