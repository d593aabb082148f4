#include "alidade/localize/map/moved_part.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "alidade/geometry/decompositions.h"
#include "alidade/localize/map/map_frame.h"

namespace alidade {
namespace {

constexpr std::size_t enough_given = 12, most_given = 600;

/// A point of the target: its given position; derivative of it by a similarity, and its deviation, both over σ.
struct GivenPlace {
  Eigen::Vector3d place, off;
  Eigen::Matrix<double, 3, 7> moves;
  double weight = 1.0;
};

/// Points of the target that are in the map, minus the best-fitting similarity.
class GivenPlaces {
 public:
  GivenPlaces(std::span<const MapPoint> map, std::span<const KnownPoint> given) {
    for (const KnownPoint& known : given) {
      const auto at = std::ranges::find(map, known.id, &MapPoint::id);
      if (at == map.end() || at->num_seen == 0 || !(known.sigma_m > 0.0)) continue;
      places_.push_back(
          {known.point_in_world, (at->point_in_world - known.point_in_world) / known.sigma_m, {}, 1.0 / known.sigma_m});
    }
    if (places_.size() < enough_given || places_.size() > most_given) return;
    fit();
  }

  [[nodiscard]] bool is_determined() const { return is_determined_; }
  [[nodiscard]] std::size_t num() const { return places_.size(); }

  /// Decrease of χ² (three components) by a shift of some of them, and its length.
  [[nodiscard]] std::pair<double, double> shift_of(std::span<const std::size_t> part) const {
    double squares = 0.0;
    Eigen::Matrix<double, 7, 3> across = Eigen::Matrix<double, 7, 3>::Zero();
    Eigen::Vector3d score = Eigen::Vector3d::Zero();
    for (const std::size_t i : part) {
      squares += places_[i].weight * places_[i].weight;
      across += places_[i].weight * places_[i].moves.transpose();
      score += places_[i].weight * places_[i].off;
    }
    const Ldlt information(squares * Eigen::Matrix3d::Identity() - across.transpose() * normal_.solve_each(across));
    constexpr double least = 0.02;  // else a similarity absorbs it
    if (!(information.min_pivot() > least * squares)) return {0.0, 0.0};
    const Eigen::Vector3d shift = information.solve(score);
    return {score.dot(shift), shift.norm()};
  }

  /// Sorted along a direction, or by distance from a point.
  template <typename Key>
  [[nodiscard]] std::vector<std::size_t> sorted_by(const Key& key) const {
    std::vector<std::size_t> order(places_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::sort(order, {}, [&](std::size_t i) { return key(places_[i].place); });
    return order;
  }
  [[nodiscard]] const Eigen::Vector3d& place(std::size_t i) const { return places_[i].place; }

  [[nodiscard]] double largest_variance() const {
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    for (const GivenPlace& each : places_) covariance += each.off * each.off.transpose();
    return symmetric_eigenvalues(covariance / static_cast<double>(places_.size())).maxCoeff();
  }

 private:
  void fit() {
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    for (const GivenPlace& each : places_) centre += each.place / static_cast<double>(places_.size());
    Eigen::Matrix<double, 7, 7> N = Eigen::Matrix<double, 7, 7>::Zero();
    Eigen::Vector<double, 7> n = Eigen::Vector<double, 7>::Zero();
    for (GivenPlace& each : places_) {
      each.moves = each.weight * similarity_moves(each.place - centre);
      N += each.moves.transpose() * each.moves;
      n += each.moves.transpose() * each.off;
    }
    normal_ = Ldlt(N);
    is_determined_ = normal_.min_pivot() > 0.0;
    if (!is_determined_) return;
    const Eigen::Vector<double, 7> similarity = normal_.solve(n);
    for (GivenPlace& each : places_) each.off -= each.moves * similarity;
  }

  std::vector<GivenPlace> places_;
  Ldlt normal_;
  bool is_determined_ = false;
};

/// Tries a shift of the first part of an order, for each share; keeps the one that explains most.
void try_parts(const GivenPlaces& places, std::span<const std::size_t> order, std::span<const double> shares,
               MovedPart& best) {
  constexpr std::size_t least_points = 4;
  for (const double share : shares) {
    const auto num = static_cast<std::size_t>(share * static_cast<double>(order.size()));
    if (num < least_points) continue;
    const auto [chi2, shift_m] = places.shift_of(order.first(num));
    if (!(chi2 > best.chi2)) continue;
    best.chi2 = chi2;
    best.num = num;
    best.shift_m = shift_m;
  }
}

/// Limit of the largest eigenvalue of a 3 × 3 covariance of n noise points, at 99.9 %.
double noise_limit(std::size_t n) {
  constexpr double at_999 = 3.27;  // of the Tracy–Widom distribution (C. A. Tracy & H. Widom)
  const double a = std::sqrt(static_cast<double>(n) - 1.0), b = std::sqrt(3.0);
  return (a + b) * ((a + b) + at_999 * std::cbrt(1.0 / a + 1.0 / b)) / static_cast<double>(n);
}

}  // namespace

MovedPart moved_part(std::span<const MapPoint> map, std::span<const KnownPoint> given) {
  constexpr std::array<double, 5> across{0.25, 0.375, 0.5, 0.625, 0.75};
  constexpr std::array<double, 3> about{0.125, 0.25, 0.5};
  const GivenPlaces places(map, given);
  MovedPart found;
  if (!places.is_determined()) return found;
  found.num_given = places.num();
  for (int x = -1; x <= 1; ++x)
    for (int y = -1; y <= 1; ++y)
      for (int z = 0; z <= 1; ++z) {
        const Eigen::Vector3d along(x, y, z);
        if (x == 0 && y == 0 && z == 0) continue;
        try_parts(places, places.sorted_by([&](const Eigen::Vector3d& at) { return along.dot(at); }), across, found);
      }
  for (std::size_t i = 0; i < places.num(); ++i)
    try_parts(places, places.sorted_by([&](const Eigen::Vector3d& at) { return (at - places.place(i)).norm(); }), about,
              found);
  found.spread = places.largest_variance();
  found.spread_limit = noise_limit(places.num());
  return found;
}

}  // namespace alidade
