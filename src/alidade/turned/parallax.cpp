#include "alidade/turned/parallax.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

namespace alidade {
namespace {

/// A match's misfit in photo b, and how a step of the camera along x, y, z would move the point there.
struct Misfit {
  Eigen::Vector2d residual;
  Eigen::Matrix<double, 2, 3> by_step;
};

using PairMisfits = std::map<std::pair<int, int>, std::vector<Misfit>>;

/// Of the tracks' neighbouring observations.
PairMisfits misfits_of(const TurnedFit& fit) {
  PairMisfits misfits;
  const TurnedBundle& bundle = fit.bundle;
  for (std::size_t i = 0; i < bundle.observations.size(); ++i) {
    for (std::size_t j = i + 1;
         j < bundle.observations.size() && bundle.observations[j].track == bundle.observations[i].track; ++j) {
      const bool in_order = bundle.observations[i].photo < bundle.observations[j].photo;
      const TurnedDetection &from = bundle.observations[in_order ? i : j], &to = bundle.observations[in_order ? j : i];
      const auto a = static_cast<std::size_t>(from.photo), b = static_cast<std::size_t>(to.photo);
      const auto ray = turned_ray(bundle.camera, bundle.log_zoom[a], from.px);
      if (!ray) continue;
      TurnedPrediction seen;
      const Eigen::Matrix3d b_from_a = turn_between(bundle, a, b);
      if (!predict_turned(bundle.camera, b_from_a, bundle.log_zoom[b], *ray, seen)) continue;
      misfits[{from.photo, to.photo}].push_back({seen.px - to.px, seen.J_ray * b_from_a.transpose()});
    }
  }
  return misfits;
}

/// Directions spread evenly over half a sphere (Fibonacci's lattice).
std::vector<Eigen::Vector3d> directions() {
  constexpr int count = 200;
  std::vector<Eigen::Vector3d> all;
  for (int i = 0; i < count; ++i) {
    const double z = (i + 0.5) / count, r = std::sqrt(1.0 - z * z);
    const double angle = std::numbers::pi * (1.0 + std::sqrt(5.0)) * i;
    all.emplace_back(r * std::cos(angle), r * std::sin(angle), z);
  }
  return all;
}

struct Anisotropy {
  double z = 0.0, excess = 0.0;  ///< In its σ; mean square along less that across.
};

Anisotropy along_lines(const std::vector<Misfit>& misfits, const Eigen::Vector3d& step) {
  double sum = 0.0, fourth = 0.0;
  for (const Misfit& misfit : misfits) {
    const Eigen::Vector2d line = (misfit.by_step * step).normalized();
    const double along = misfit.residual.dot(line), all = misfit.residual.squaredNorm();
    if (!line.allFinite()) continue;
    sum += 2.0 * along * along - all;
    fourth += all * all;
  }
  if (!(fourth > 0.0)) return {};
  return {sum / std::sqrt(0.5 * fourth), sum / static_cast<double>(misfits.size())};
}

}  // namespace

ParallaxTest parallax_of(const TurnedFit& fit) {
  constexpr std::size_t min_matches = 20;
  const std::vector<Eigen::Vector3d> steps = directions();
  ParallaxTest test;
  double squares = 0.0, turns = 0.0, count = 0.0;
  for (const auto& [photos, misfits] : misfits_of(fit)) {
    if (misfits.size() < min_matches) continue;
    Anisotropy most;
    for (const Eigen::Vector3d& step : steps) {
      const Anisotropy each = along_lines(misfits, step);
      if (each.z > most.z) most = each;
    }
    const Eigen::Matrix3d turn =
        turn_between(fit.bundle, static_cast<std::size_t>(photos.first), static_cast<std::size_t>(photos.second));
    const double angle = std::acos(std::clamp(0.5 * (turn.trace() - 1.0), -1.0, 1.0));
    const double weight = static_cast<double>(misfits.size());
    // noise alone reaches three σ over so many directions
    const double noise = most.z > 0.0 ? most.excess / most.z : 0.0;
    squares += weight * std::max(most.excess - 3.0 * noise, 0.0);
    turns += weight * angle * angle;
    count += weight;
    if (most.z <= test.z) continue;
    test.z = most.z;
    test.photo_a = photos.first;
    test.photo_b = photos.second;
  }
  if (!(count > 0.0)) return test;
  test.rms_px = std::sqrt(squares / count);  // normalised: the caller knows the scale
  const double focal = 0.5 * (fit.bundle.camera[0] + fit.bundle.camera[1]);
  // observable is the scatter of the points' inverse distances, typically half their mean; the mean looks like a
  // longer lens
  constexpr double mean_over_scatter = 2.0;
  test.relative = turns > 0.0 ? mean_over_scatter * std::sqrt(squares / turns) / focal : 0.0;
  return test;
}

}  // namespace alidade
