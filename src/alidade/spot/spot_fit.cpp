#include "alidade/spot/spot_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "alidade/estimation/median.h"

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
  Eigen::Matrix2d noise = Eigen::Matrix2d::Zero();    ///< Of `first` about the centroid.
  Eigen::Matrix2d speckle = Eigen::Matrix2d::Zero();  ///< The same of noise as large as the light.
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
    sums.noise += weight * weight * (signal.sum_sigma * signal.sum_sigma + edge * edge) * offset * offset.transpose();
    sums.speckle += weight * weight * light * light * offset * offset.transpose();
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

/// Noise that grows with the light, over the light, as white noise: what of the odd moments of third and fifth order is
/// beyond the noise. A symmetric spot has none. Hermite's polynomials of √2 x/r times the spot's own Gaussian are
/// orthogonal to what a displacement of it changes.
double speckle_of(const SpotSignal& signal, const SpotPlace& spot) {
  const auto hermite = [](double x) {
    const double x2 = x * x;
    return std::array<double, 6>{
        1.0, x, x2 - 1.0, x * (x2 - 3.0), x2 * x2 - 6.0 * x2 + 3.0, x * (x2 * x2 - 10.0 * x2 + 15.0)};
  };
  constexpr std::array<std::size_t, 2> orders{3, 5};
  std::array<double, 10> moments{}, noise{}, squares{};
  for_each_around(signal, spot.px, disc_radius(spot.radius_px),
                  [&](Eigen::Index v, Eigen::Index u, const auto& offset) {
                    const double light = static_cast<double>(signal.light(v, u)) - spot.offset_light;
                    const Eigen::Vector2d at = std::numbers::sqrt2 / spot.radius_px * offset;
                    const auto x = hermite(at.x()), y = hermite(at.y());
                    const double own = std::exp(-0.25 * at.squaredNorm());
                    std::size_t k = 0;
                    for (const std::size_t order : orders)
                      for (std::size_t i = 0; i <= order; ++i, ++k) {
                        const double weight = own * x[i] * y[order - i];
                        moments[k] += weight * light;
                        noise[k] += weight * weight;
                        squares[k] += weight * weight * light * light;
                      }
                  });
  double excess = 0.0, num = 0.0;
  for (std::size_t k = 0; k < moments.size(); ++k) {
    if (!(squares[k] > 0.0)) continue;
    excess += (moments[k] * moments[k] - noise[k] * signal.sum_sigma * signal.sum_sigma) / squares[k];
    num += 1.0;
  }
  return speckle_contrast(excess, num);
}

/// σ of the centroid of samples 2 px apart, of which demosaicing makes those between: by Poisson's sum formula it errs
/// by 4πσ²/P · exp(−2π²σ²/P²) · sin(2πx/P), and interpolation has widened the spot by P²/6.
double mosaic_sigma_px(double radius_px) {
  constexpr double pitch_px = 2.0, pi = std::numbers::pi;
  const double square = std::max(0.25, radius_px * radius_px - pitch_px * pitch_px / 6.0);
  return std::sqrt(0.5) * 4.0 * pi * square / pitch_px * std::exp(-2.0 * pi * pi * square / (pitch_px * pitch_px));
}

Eigen::Matrix2d centroid_cov(const SpotSignal& signal, const SpotPlace& spot, const DiscSums& sums) {
  constexpr double rim_gain = 1.0 / 0.95;     // the disc follows the noise a little
  constexpr double sampling_sigma_px = 0.01;  // sums over pixels instead of integrals, perspective over the spot
  const double speckle = speckle_of(signal, spot);
  double own = sampling_sigma_px * sampling_sigma_px * (spot.is_saturated ? 10.0 : 1.0);
  // What was compressed comes of a camera with a mosaic, as a rule.
  if (signal.is_interpolated) own += std::pow(mosaic_sigma_px(spot.radius_px), 2);
  return (rim_gain * rim_gain * sums.noise + speckle * speckle * sums.speckle) / (sums.light * sums.light) +
         own * Eigen::Matrix2d::Identity();
}

}  // namespace

double speckle_contrast(double excess, double num) {
  constexpr double usual = 0.15, weight = 3.0;
  return std::sqrt((std::max(0.0, excess) + weight * usual * usual) / (num + weight));
}

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
  spot.cov = centroid_cov(signal, spot, sums);
  spot.is_on_edge = is_on_edge(signal, spot);
  if (!spot.is_on_edge) return spot;
  return fit_on_edge(signal, spot);
}

}  // namespace alidade
