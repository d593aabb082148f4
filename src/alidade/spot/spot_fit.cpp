#include "alidade/spot/spot_fit.h"
#include "alidade/estimation/median.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace alidade {
namespace {

/// Pixels of a square around a point, cut at the part's border.
template <class Visit>
void for_each_around(const SpotSignal& signal, const Eigen::Vector2d& px, double reach, const Visit& visit) {
  const auto low = [](double at) { return std::max<Eigen::Index>(0, static_cast<Eigen::Index>(std::ceil(at))); };
  const auto high = [](double at, Eigen::Index size) {
    return std::min(size - 1, static_cast<Eigen::Index>(std::floor(at)));
  };
  for (Eigen::Index v = low(px.y() - reach); v <= high(px.y() + reach, signal.light.rows()); ++v)
    for (Eigen::Index u = low(px.x() - reach); u <= high(px.x() + reach, signal.light.cols()); ++u)
      visit(v, u, Eigen::Vector2d(static_cast<double>(u), static_cast<double>(v)) - px);
}

double disc_radius(double radius_px) { return 3.0 * radius_px + 1.0; }

/// Median light in the ring around the disc: what the background's model misses there.
double ring_light(const SpotSignal& signal, const Eigen::Vector2d& px, double radius_px) {
  const double inner = disc_radius(radius_px) + 1.0, outer = inner + 4.0;
  std::vector<float> values;
  for_each_around(signal, px, outer, [&](Eigen::Index v, Eigen::Index u, const Eigen::Vector2d& offset) {
    const double distance = offset.norm();
    if (distance >= inner && distance <= outer && signal.is_saturated(v, u) == 0) values.push_back(signal.light(v, u));
  });
  if (values.size() < 8) return 0.0;
  return static_cast<double>(median_of(std::move(values)));
}

/// Sums over the disc; the pixels on its rim count in part, so that it moves smoothly.
struct DiscSums {
  double light = 0.0, second = 0.0, peak = 0.0;
  Eigen::Vector2d first = Eigen::Vector2d::Zero();
  Eigen::Matrix2d noise = Eigen::Matrix2d::Zero();  ///< Of `first` about the centroid.
};

DiscSums sums_in_disc(const SpotSignal& signal, const Eigen::Vector2d& px, double radius_px, double offset_light) {
  DiscSums sums;
  const double radius = disc_radius(radius_px);
  // Errors at an edge are alike along it, over about four pixels of a disc; those of a model over all of it.
  const double edge_factor = (signal.is_modelled ? 4.0 : 2.0) * signal.edge_sigma_px;
  for_each_around(signal, px, radius + 1.0, [&](Eigen::Index v, Eigen::Index u, const Eigen::Vector2d& offset) {
    const double weight = std::clamp(radius + 0.5 - offset.norm(), 0.0, 1.0);
    const double light = static_cast<double>(signal.light(v, u)) - offset_light;
    const double edge = edge_factor * static_cast<double>(signal.edge(v, u));
    sums.light += weight * light;
    sums.first += weight * light * offset;
    sums.second += weight * light * offset.squaredNorm();
    sums.noise += weight * weight * (signal.sigma * signal.sigma + edge * edge) * offset * offset.transpose();
    if (weight > 0.5) sums.peak = std::max(sums.peak, light);
  });
  return sums;
}

/// Whether ink and paper share the spot. A background that sees the laser is looked at around the spot only.
bool is_on_edge(const SpotSignal& signal, const SpotPlace& spot) {
  const double outer = (signal.background_is_lit ? 3.0 : 2.5) * spot.radius_px + 1.5;
  const double inner = signal.background_is_lit ? 2.2 * spot.radius_px : 0.0;
  float low = std::numeric_limits<float>::infinity(), high = 0.0F;
  for_each_around(signal, spot.px, outer, [&](Eigen::Index v, Eigen::Index u, const Eigen::Vector2d& offset) {
    const bool is_inside = v > 0 && u > 0 && v + 1 < signal.light.rows() && u + 1 < signal.light.cols();
    if (offset.norm() > outer || offset.norm() < inner || !is_inside) return;
    const float mean = signal.background.block<3, 3>(v - 1, u - 1).mean();
    low = std::min(low, mean);
    high = std::max(high, mean);
  });
  // The means of nine noisy pixels spread by 1.5 σ over a disc.
  return high - low > std::max(0.2F * high, static_cast<float>(2.5 * signal.sigma));
}

}  // namespace

SpotPlace measure_spot(const SpotSignal& signal, const SpotCandidate& candidate) {
  SpotPlace spot;
  spot.px = candidate.px;
  spot.radius_px = candidate.radius_px;
  DiscSums sums;
  double offset_light = 0.0;
  constexpr int iterations = 10;  // the disc's rim holds 1 % of the peak: each step leaves a twentieth
  for (int i = 0; i < iterations; ++i) {
    offset_light = ring_light(signal, spot.px, spot.radius_px);
    sums = sums_in_disc(signal, spot.px, spot.radius_px, offset_light);
    if (!(sums.light > 0.0)) {
      spot.reason = "no laser spot";
      return spot;
    }
    const Eigen::Vector2d step = sums.first / sums.light;
    spot.px += step;
    const double mean_square = 0.5 * (sums.second / sums.light - step.squaredNorm());
    spot.radius_px =
        std::clamp(std::sqrt(std::max(0.0, mean_square)), 0.7 * candidate.radius_px, 1.5 * candidate.radius_px + 0.5);
    if (!(std::abs(spot.px.x() - candidate.px.x()) < 3.0 * candidate.radius_px + 2.0) ||
        !(std::abs(spot.px.y() - candidate.px.y()) < 3.0 * candidate.radius_px + 2.0)) {
      spot.reason = "no laser spot";
      return spot;
    }
  }
  spot.peak = sums.peak;
  spot.offset_light = offset_light;
  spot.is_saturated = candidate.is_saturated;
  constexpr double rim_gain = 1.0 / 0.95;     // the disc follows the noise a little
  constexpr double sampling_sigma_px = 0.01;  // sums over pixels instead of integrals, perspective over the spot
  spot.cov = rim_gain * rim_gain * sums.noise / (sums.light * sums.light) +
             sampling_sigma_px * sampling_sigma_px * Eigen::Matrix2d::Identity();
  if (candidate.is_saturated) spot.cov += 9.0 * sampling_sigma_px * sampling_sigma_px * Eigen::Matrix2d::Identity();
  spot.is_on_edge = is_on_edge(signal, spot);
  if (!spot.is_on_edge) return spot;
  return fit_on_edge(signal, spot);
}

}  // namespace alidade
