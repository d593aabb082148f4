#include "alidade/turned/parallax.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

namespace alidade {
namespace {

/// Residual of a match in photo b, and its derivative by a translation of the camera along x, y, z.
struct Misfit {
  Eigen::Vector2d px, residual;
  Eigen::Matrix<double, 2, 3> by_step;
};

using PairMisfits = std::map<std::pair<int, int>, std::vector<Misfit>>;

/// For each pair of photos, from the tracks that both observe.
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
      misfits[{from.photo, to.photo}].push_back({to.px, seen.px - to.px, seen.J_ray * b_from_a.transpose()});
    }
  }
  return misfits;
}

/// Directions spread evenly over a hemisphere (Fibonacci lattice).
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
  double z = 0.0, excess = 0.0;  ///< Score in σ; mean square along the lines minus that across.
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

/// A sum of products with zero mean, and its score in σ estimated from their squares.
struct Products {
  double sum = 0.0, squares = 0.0;
  void add(double product) {
    sum += product;
    squares += product * product;
  }
  [[nodiscard]] double z() const { return squares > 0.0 ? sum / std::sqrt(squares) : 0.0; }
};

/// Score of the correlation between residuals of neighbours in a photo. Most neighbours are on one surface and thus at
/// one distance; their noise is independent in any direction, unless they are so close that they share image content.
double of_neighbours(std::vector<Misfit> misfits) {
  constexpr double closest = 0.025, farthest = 0.1;  // half widths
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Misfit& misfit : misfits) mean += misfit.residual / static_cast<double>(misfits.size());
  std::ranges::sort(misfits, {}, [](const Misfit& misfit) { return misfit.px.x(); });
  Products products;
  for (auto a = misfits.begin(); a != misfits.end(); ++a) {
    for (auto b = a + 1; b != misfits.end() && b->px.x() - a->px.x() < farthest; ++b) {
      const double apart = (b->px - a->px).norm();
      if (apart > closest && apart < farthest) products.add((a->residual - mean).dot(b->residual - mean));
    }
  }
  return products.z();
}

/// The smallest shift of each ray, in the world frame, that explains its residual.
Eigen::Matrix3Xd ray_shifts(const TurnedFit& fit) {
  const TurnedBundle& bundle = fit.bundle;
  Eigen::Matrix3Xd shifts = Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(bundle.observations.size()));
  for (std::size_t i = 0; i < bundle.observations.size(); ++i) {
    const TurnedDetection& seen = bundle.observations[i];
    const auto k = static_cast<std::size_t>(seen.photo);
    TurnedPrediction at;
    if (!predict_turned(bundle.camera, bundle.cam_from_world[k], bundle.log_zoom[k],
                        bundle.rays[static_cast<std::size_t>(seen.track)], at))
      continue;
    const Eigen::Matrix2d square = at.J_ray * at.J_ray.transpose();
    shifts.col(static_cast<Eigen::Index>(i)) = at.J_ray.transpose() * (square.inverse() * (at.px - seen.px));
  }
  return shifts;
}

/// Score of the agreement of two disjoint pairs of photos on the distance of a point, from the lever between
/// camera centre and rotation centre. The noise of such pairs is independent, even for a single point.
double of_one_lever(const TurnedFit& fit) {
  const std::vector<TurnedDetection>& seen = fit.bundle.observations;
  const Eigen::Matrix3Xd shifts = ray_shifts(fit);
  Products products;
  for (std::size_t begin = 0, end = 0; begin < seen.size(); begin = end) {
    while (end < seen.size() && seen[end].track == seen[begin].track) ++end;
    if (end - begin < 4) continue;
    // with the pairs' levers h: Σ h_p·h_q over pairs that share no photo, from the sum of all and the sums per photo
    Eigen::Matrix3Xd of_photo = Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(end - begin));
    double squares = 0.0;
    for (std::size_t i = begin; i < end; ++i) {
      for (std::size_t j = i + 1; j < end; ++j) {
        const Eigen::Matrix3d turned = fit.bundle.cam_from_world[static_cast<std::size_t>(seen[j].photo)] -
                                       fit.bundle.cam_from_world[static_cast<std::size_t>(seen[i].photo)];
        const Eigen::Vector3d h =
            turned * (shifts.col(static_cast<Eigen::Index>(j)) - shifts.col(static_cast<Eigen::Index>(i)));
        of_photo.col(static_cast<Eigen::Index>(i - begin)) += h;
        of_photo.col(static_cast<Eigen::Index>(j - begin)) += h;
        squares += h.squaredNorm();
      }
    }
    products.add((0.5 * of_photo.rowwise().sum()).squaredNorm() + squares - of_photo.squaredNorm());
  }
  return products.z();
}

}  // namespace

ParallaxTest parallax_of(const TurnedFit& fit) {
  constexpr std::size_t min_matches = 20;
  const std::vector<Eigen::Vector3d> steps = directions();
  ParallaxTest test;
  double squares = 0.0, turns = 0.0, count = 0.0, agree = 0.0;
  for (const auto& [photos, misfits] : misfits_of(fit)) {
    if (misfits.size() < min_matches) continue;
    agree = std::max(agree, of_neighbours(misfits));
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
  // a match is precise across an edge but not along it: such directional noise does not agree with anything else
  constexpr double surely = 3.3, surely_of_pairs = 4.5;  // for one test, for the largest of the pairs
  const double of_lever = of_one_lever(fit);
  if (of_lever < surely && agree < surely_of_pairs) test.z = std::min(test.z, std::max(of_lever, agree));
  test.rms_px = std::sqrt(squares / count);  // normalised: the caller converts it
  const double focal = 0.5 * (fit.bundle.camera[0] + fit.bundle.camera[1]);
  // only the scatter of the points' inverse distances is observable, typically half their mean; the mean acts like a
  // longer focal length
  constexpr double mean_over_scatter = 2.0;
  test.relative = turns > 0.0 ? mean_over_scatter * std::sqrt(squares / turns) / focal : 0.0;
  return test;
}

}  // namespace alidade
