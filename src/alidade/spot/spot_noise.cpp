#include "alidade/spot/spot_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "alidade/estimation/median.h"

namespace alidade {
namespace {

constexpr Eigen::Index max_lag = 3;  // of a colour that one of two pixels an axis has, interpolated
constexpr Eigen::Index far_lag = 6;  // what is alike so far away is the background's
constexpr double step_px = 4.6;      // derived at compression_step()

/// Where nothing but noise is expected.
struct EvenPixels {
  ImageMask mask;
  std::vector<Eigen::Vector2<Eigen::Index>> sample;  ///< v, u
  std::size_t num_looked = 0;
  double mean = 0.0;
};

float strong_edge(const SpotSignal& signal) { return std::max(8.0F, 0.4F * signal.edge.maxCoeff()); }

EvenPixels even_pixels(const SpotSignal& signal) {
  EvenPixels even;
  const auto limit = static_cast<float>(4.0 * signal.sigma);
  even.mask = ((signal.is_in_region > 0) && (signal.is_saturated == 0) && (signal.edge < 0.3F * strong_edge(signal)) &&
               (signal.detected.abs() < limit))
                  .cast<unsigned char>();
  const Eigen::Index step = stride_of(signal.detected.size() / 3);
  for (Eigen::Index v = far_lag; v + far_lag < signal.detected.rows(); ++v) {
    for (Eigen::Index u = far_lag + v % step; u + far_lag < signal.detected.cols(); u += step * step) {
      ++even.num_looked;
      if (even.mask(v, u) == 0) continue;
      even.sample.emplace_back(v, u);
      even.mean += static_cast<double>(signal.detected(v, u));
    }
  }
  even.mean /= static_cast<double>(std::max<std::size_t>(1, even.sample.size()));
  return even;
}

/// Mean product of pixels so far apart.
double autocovariance(const SpotSignal& signal, const EvenPixels& even, Eigen::Index dv, Eigen::Index du) {
  double sum = 0.0, num = 0.0;
  for (const auto& at : even.sample) {
    const Eigen::Index v = at[0] + dv, u = at[1] + du;
    if (even.mask(v, u) == 0) continue;
    sum += (static_cast<double>(signal.detected(at[0], at[1])) - even.mean) *
           (static_cast<double>(signal.detected(v, u)) - even.mean);
    num += 1.0;
  }
  return num > 0.0 ? sum / num : 0.0;
}

/// Noise of sums over many pixels and of the smoothed image, by the autocovariances: neighbours that demosaicing
/// interpolates share their noise. Of a colour that one pixel of four has a sum's σ is 4/√(9/4) = 2.7 times that of
/// white noise as large.
void measure_shared_noise(const EvenPixels& even, SpotSignal& signal) {
  signal.sum_sigma = signal.sigma;
  signal.smoothed_sigma = 0.5 / std::sqrt(std::numbers::pi) * signal.sigma;  // of a Gaussian of 1 px
  constexpr std::size_t enough = 300, share = 12;
  if (even.sample.size() < enough || share * even.sample.size() < even.num_looked) {
    signal.sum_sigma *= 2.7;  // small squares: what lies between their edges is not noise; as large as a mosaic's
    return;
  }
  const double own = autocovariance(signal, even, 0, 0);
  if (!(own > 1e-3)) return;
  const double far = 0.5 * (autocovariance(signal, even, 0, far_lag) + autocovariance(signal, even, far_lag, 0));
  double sum = own - far, smoothed = own - far;
  for (Eigen::Index dv = 0; dv <= max_lag; ++dv) {
    for (Eigen::Index du = dv == 0 ? 1 : -max_lag; du <= max_lag; ++du) {
      const double shared = 2.0 * (autocovariance(signal, even, dv, du) - far);
      sum += shared;
      smoothed += shared * std::exp(-0.25 * static_cast<double>(dv * dv + du * du));
    }
  }
  signal.sum_sigma *= std::sqrt(std::clamp(sum / own, 1.0, 16.0));
  signal.smoothed_sigma *= std::sqrt(std::clamp(smoothed / own, 1.0, 16.0));
}

/// Steps between the levels of areas that are flat. A sensor's noise leaves none; JPEG quantises it away, with steps s
/// of the colours' mean over a block of 8 × 8 colour pixels, 16 × 16 of the photo's.
double compression_step(const EvenPixels& even, const SpotSignal& signal) {
  std::vector<float> levels;
  for (const auto& at : even.sample) {
    const auto around = signal.detected.block<3, 3>(at[0] - 1, at[1] - 1);
    if (around.maxCoeff() - around.minCoeff() < 0.35F) levels.push_back(signal.detected(at[0], at[1]));
  }
  constexpr double least_step = 1.5;  // rounding of three channels
  if (even.sample.size() < 30 || 3 * levels.size() < even.sample.size()) return 0.0;
  std::sort(levels.begin(), levels.end());
  const std::size_t few = 1 + levels.size() / 200;
  double step = least_step;
  for (std::size_t i = few; i + few < levels.size(); ++i)
    step = std::max(step, static_cast<double>(levels[i] - levels[i - 1]));
  return step;
}

/// Medians and ninth deciles of what is at the background's edges.
struct AtEdges {
  std::vector<float> of_pixel, of_smoothed;
  double mean_edge = 0.0, mean_smoothed_edge = 0.0;
  std::size_t num_even = 0;
};

AtEdges at_edges(const SpotSignal& signal) {
  AtEdges found;
  const Image smoothed = smoothed_image(signal.detected), smoothed_edge = smoothed_image(signal.edge);
  const float strong = strong_edge(signal);
  const Eigen::Index step = stride_of(signal.detected.size() / 3);
  for (Eigen::Index v = 1; v + 1 < signal.detected.rows(); ++v) {
    for (Eigen::Index u = 1 + v % step; u + 1 < signal.detected.cols(); u += step * step) {
      if (signal.is_in_region(v, u) == 0 || signal.is_saturated(v, u) != 0) continue;
      const float edge = signal.edge(v, u);
      found.num_even += edge < 0.3F * strong;
      if (edge < strong) continue;
      found.of_pixel.push_back(std::abs(signal.detected(v, u)));
      found.of_smoothed.push_back(std::abs(smoothed(v, u)));
      found.mean_edge += static_cast<double>(edge);
      found.mean_smoothed_edge += static_cast<double>(smoothed_edge(v, u));
    }
  }
  const double num = static_cast<double>(std::max<std::size_t>(1, found.of_pixel.size()));
  found.mean_edge /= num;
  found.mean_smoothed_edge /= num;
  return found;
}

/// What is left at the background's edges beyond the noise, as a displacement.
void measure_edges(SpotSignal& signal) {
  AtEdges edges = at_edges(signal);
  // A print has many edges; those of a few pixels may be the spot's own light in the other channels.
  if (edges.of_pixel.size() < 20 || 50 * edges.of_pixel.size() < edges.num_even) return;
  constexpr double max_edge_sigma_px = 0.3;  // what is worse was not compared with its like
  const auto as_px = [&](double rest, double noise, double edge) {
    return std::min(max_edge_sigma_px, std::sqrt(std::max(0.0, rest * rest - noise * noise)) / edge);
  };
  // Colours that demosaicing invents at edges alternate from pixel to pixel; what of them remains when smoothed is in
  // few places and large: the tenth part of the pixels counts, too.
  constexpr double normal_90 = 1.6449;
  const auto tenth = edges.of_smoothed.begin() + static_cast<std::ptrdiff_t>(9 * edges.of_smoothed.size() / 10);
  std::nth_element(edges.of_smoothed.begin(), tenth, edges.of_smoothed.end());
  signal.smoothed_edge_sigma_px =
      as_px(static_cast<double>(*tenth) / normal_90, signal.smoothed_sigma, edges.mean_smoothed_edge);
  const double rest = normal_from_mad * static_cast<double>(median_of(std::move(edges.of_pixel)));
  signal.edge_sigma_px = std::max(signal.smoothed_edge_sigma_px, as_px(rest, signal.sigma, edges.mean_edge));
}

double noise_of_even(const SpotSignal& signal) {
  std::vector<float> even;
  const float strong = strong_edge(signal);
  const Eigen::Index step = stride_of(signal.detected.size() / 3);
  for (Eigen::Index v = 1; v + 1 < signal.detected.rows(); ++v)
    for (Eigen::Index u = 1 + v % step; u + 1 < signal.detected.cols(); u += step * step)
      if (signal.is_in_region(v, u) != 0 && signal.is_saturated(v, u) == 0 && signal.edge(v, u) < 0.3F * strong)
        even.push_back(std::abs(signal.detected(v, u)));
  return std::max(0.4, normal_from_mad * static_cast<double>(median_of(std::move(even))));  // rounding alone: 0.29
}

}  // namespace

Image smoothed_image(const Image& image) {
  Image smooth = image;
  cv::Mat mat(static_cast<int>(image.rows()), static_cast<int>(image.cols()), CV_32F, smooth.data());
  cv::GaussianBlur(mat, mat, cv::Size(7, 7), 1.0, 1.0, cv::BORDER_REPLICATE);
  return smooth;
}

Eigen::Index stride_of(Eigen::Index num_pixels) {
  return std::max<Eigen::Index>(1, std::lround(std::sqrt(static_cast<double>(num_pixels) / 1e4)));
}

void measure_noise(SpotSignal& signal) {
  signal.sigma = noise_of_even(signal);  // of two photos, rounding makes 0.41
  const EvenPixels even = even_pixels(signal);
  measure_shared_noise(even, signal);
  signal.step = compression_step(even, signal);
  signal.is_interpolated = signal.step > 0.0 || signal.sum_sigma > 1.5 * signal.sigma;
  // Quantised with steps q the coefficients of a block err by q/√12; of the mean, q/8 = s. White noise of 8 s/√12 = 2.3
  // s a colour pixel would do the same; each lies on 2 × 2 of the photo's, which share it: 4.6 s.
  signal.sum_sigma = std::hypot(signal.sum_sigma, step_px * signal.step);
  signal.smoothed_sigma = std::hypot(signal.smoothed_sigma, 0.5 * signal.step);  // smoothing does not lower it
  measure_edges(signal);
}

}  // namespace alidade
