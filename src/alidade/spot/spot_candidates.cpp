#include "alidade/spot/spot_candidates.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "alidade/spot/spot_noise.h"

namespace alidade {
namespace {

constexpr float low_snr = 4.0F;  // how far down the slopes a patch reaches
constexpr int border_px = 2;     // of the part: too few neighbours to distinguish light from a single pixel's noise

/// Mean of the eight neighbours.
float ring_mean(const Image& image, Eigen::Index v, Eigen::Index u) {
  return (image.block<3, 3>(v - 1, u - 1).sum() - image(v, u)) / 8.0F;
}

/// Takes away pixels that stand alone. The narrowest spot a lens makes, σ = 0.6 px with the pixel's own width, has a
/// seventh of its peak around it on average.
void remove_hot_pixels(SpotSignal& signal) {
  const auto limit = static_cast<float>(6.0 * signal.sigma);
  for (Eigen::Index v = 1; v + 1 < signal.detected.rows(); ++v) {
    for (Eigen::Index u = 1; u + 1 < signal.detected.cols(); ++u) {
      const float peak = signal.detected(v, u);
      if (!(peak > limit)) continue;
      const float around = ring_mean(signal.detected, v, u);
      if (around > 0.08F * peak) continue;
      signal.light(v, u) = ring_mean(signal.light, v, u);
      signal.detected(v, u) = around;
      signal.is_saturated(v, u) = 0;
    }
  }
}

/// The signal smoothed, in sigmas of its noise.
Image signal_to_noise(const SpotSignal& signal) {
  const Image smooth = smoothed_image(signal.detected), edge = smoothed_image(signal.edge);
  const auto noise = static_cast<float>(signal.smoothed_sigma);
  // Errors at an edge are alike along it: smoothing does not lower them.
  return smooth / (noise * noise + (static_cast<float>(signal.smoothed_edge_sigma_px) * edge).square()).sqrt();
}

/// What white paper shows: the background's bright end in the region.
double paper_level(const SpotSignal& signal) {
  std::vector<float> values;
  for (Eigen::Index v = 0; v < signal.background.rows(); v += 3)
    for (Eigen::Index u = 0; u < signal.background.cols(); u += 3)
      if (signal.is_in_region(v, u) != 0) values.push_back(signal.background(v, u));
  if (values.empty()) return 255.0;
  const auto bright = values.begin() + static_cast<std::ptrdiff_t>(0.9 * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), bright, values.end());
  return std::max(1.0, static_cast<double>(*bright));
}

/// A patch of connected pixels: its box in the part.
struct Patch {
  cv::Rect box;
  const cv::Mat* labels;
  int label;

  [[nodiscard]] bool has(int v, int u) const { return labels->at<int>(v, u) == label; }
  template <class Visit>
  void for_each(const Visit& visit) const {
    for (int v = box.y; v < box.y + box.height; ++v)
      for (int u = box.x; u < box.x + box.width; ++u)
        if (has(v, u)) visit(v, u);
  }
};

/// Where the channel saturates its excess over other channels vanishes: a white core in a coloured ring. It gets the
/// ring's light.
void fill_saturated(SpotSignal& signal, const Patch& patch) {
  float most = 0.0F;
  patch.for_each([&](int v, int u) { most = std::max(most, signal.light(v, u)); });
  patch.for_each([&](int v, int u) {
    if (signal.is_saturated(v, u) != 0) signal.light(v, u) = most;
  });
}

struct Moments {
  double sum = 0.0, background = 0.0;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d cov = Eigen::Matrix2d::Zero();
};

Moments moments_of(const SpotSignal& signal, const Patch& patch) {
  Moments moments;
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  const Eigen::Vector2d origin(patch.box.x, patch.box.y);
  patch.for_each([&](int v, int u) {
    const double light = std::max(0.0, static_cast<double>(signal.light(v, u)));
    const Eigen::Vector2d at = Eigen::Vector2d(u, v) - origin;
    moments.sum += light;
    moments.background += light * static_cast<double>(signal.background(v, u));
    moments.mean += light * at;
    squares += light * at * at.transpose();
  });
  if (!(moments.sum > 0.0)) return moments;
  moments.mean /= moments.sum;
  moments.background /= moments.sum;
  moments.cov = squares / moments.sum - moments.mean * moments.mean.transpose();
  moments.mean += origin;
  return moments;
}

/// Whether a patch is as small and as round as a spot.
bool is_spot_like(const Moments& moments, const SpotCandidate& spot, const LaserSpotConfig& config) {
  const double mean_square = 0.5 * moments.cov.trace(), area = std::sqrt(std::max(0.0, moments.cov.determinant()));
  constexpr double max_elongation = 5.0;  // a board tilted by 78°; a streak along an edge is longer
  const double half_difference = std::sqrt(std::max(0.0, mean_square * mean_square - area * area));
  const double longest = mean_square + half_difference, shortest = std::max(1.0 / 12.0, mean_square - half_difference);
  return spot.radius_px <= config.max_radius_px && longest <= max_elongation * max_elongation * shortest;
}

SpotCandidate candidate_of(SpotSignal& signal, const Patch& patch, const Moments& moments, double paper) {
  SpotCandidate spot;
  spot.px = moments.mean;
  spot.radius_px = std::sqrt(std::max(0.25, 0.5 * moments.cov.trace()));
  spot.strength = moments.sum * paper / std::clamp(moments.background, 0.1 * paper, paper);
  int num_saturated = 0;
  patch.for_each([&](int v, int u) { num_saturated += signal.is_saturated(v, u) != 0; });
  spot.is_saturated = num_saturated >= 3;
  const cv::Rect in_photo = patch.box + cv::Point(signal.u_min, signal.v_min);
  if (in_photo.x <= border_px || in_photo.y <= border_px ||
      in_photo.x + in_photo.width >= signal.photo_cols - border_px ||
      in_photo.y + in_photo.height >= signal.photo_rows - border_px) {
    spot.reason = "is cut by the photo's border";
  }
  return spot;
}

}  // namespace

std::vector<SpotCandidate> spot_candidates(SpotSignal& signal, const LaserSpotConfig& config) {
  remove_hot_pixels(signal);
  Image snr = signal_to_noise(signal);
  snr.topRows(border_px) = snr.bottomRows(border_px) = 0.0F;
  snr.leftCols(border_px) = snr.rightCols(border_px) = 0.0F;
  const double paper = paper_level(signal);
  // Colours that demosaicing and compression invent are not normally distributed.
  const double min_snr = (signal.is_interpolated ? 1.5 : 1.0) * config.min_snr;
  ImageMask lit = ((snr > low_snr) || (signal.is_saturated > 0)).cast<unsigned char>();
  const cv::Mat mask(static_cast<int>(lit.rows()), static_cast<int>(lit.cols()), CV_8U, lit.data());
  cv::Mat labels, boxes, centroids;
  const int num_labels = cv::connectedComponentsWithStats(mask, labels, boxes, centroids, 8, CV_32S);
  std::vector<SpotCandidate> spots;
  for (int label = 1; label < num_labels; ++label) {
    const int* box = boxes.ptr<int>(label);
    const Patch patch{
        cv::Rect(box[cv::CC_STAT_LEFT], box[cv::CC_STAT_TOP], box[cv::CC_STAT_WIDTH], box[cv::CC_STAT_HEIGHT]), &labels,
        label};
    float peak = 0.0F;
    patch.for_each([&](int v, int u) { peak = std::max(peak, snr(v, u)); });
    if (!(static_cast<double>(peak) > min_snr)) continue;
    fill_saturated(signal, patch);
    const Moments moments = moments_of(signal, patch);
    if (!(moments.sum > 0.0)) continue;
    SpotCandidate spot = candidate_of(signal, patch, moments, paper);
    spot.snr = static_cast<double>(peak);
    const auto v = static_cast<Eigen::Index>(std::lround(spot.px.y())),
               u = static_cast<Eigen::Index>(std::lround(spot.px.x()));
    if (signal.is_in_region(v, u) == 0 || !is_spot_like(moments, spot, config)) continue;
    spots.push_back(std::move(spot));
  }
  std::sort(spots.begin(), spots.end(), [](const auto& a, const auto& b) { return a.strength > b.strength; });
  return spots;
}

}  // namespace alidade
