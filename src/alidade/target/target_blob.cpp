#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "alidade/estimation/median.h"
#include "alidade/target/target_search.h"

namespace alidade {
namespace {

/// Some ten thousand values of an image, evenly spread.
std::vector<float> sample_of(const cv::Mat& image) {
  const std::size_t wanted = 10000;
  const int step = std::max(1, static_cast<int>(std::sqrt(static_cast<double>(image.total() / wanted))));
  std::vector<float> values;
  for (int v = 0; v < image.rows; v += step)
    for (int u = 0; u < image.cols; u += step) values.push_back(image.at<float>(v, u));
  return values;
}

/// How much of the colour a pixel has: its deviation from grey along the colour's, less what it has across.
cv::Mat colour_signal(const cv::Mat& bgr, const Eigen::Vector3d& rgb) {
  const Eigen::Vector3d chroma = (rgb.array() - rgb.mean()).matrix().normalized();
  const Eigen::Vector3f along(static_cast<float>(chroma.z()), static_cast<float>(chroma.y()),
                              static_cast<float>(chroma.x()));  // in the pixel's order, BGR
  constexpr float across_weight = 1.5F;                         // nothing is left 34° of hue beside
  cv::Mat signal(bgr.size(), CV_32F);
  for (int v = 0; v < bgr.rows; ++v) {
    const auto* in = bgr.ptr<cv::Vec3b>(v);
    auto* out = signal.ptr<float>(v);
    for (int u = 0; u < bgr.cols; ++u) {
      Eigen::Vector3f pixel(in[u][0], in[u][1], in[u][2]);
      pixel.array() -= pixel.mean();
      const float a = along.dot(pixel);
      out[u] = a <= 0.0F ? 0.0F : a - across_weight * std::sqrt(std::max(0.0F, pixel.squaredNorm() - a * a));
    }
  }
  return signal;
}

cv::Mat signal_of(const cv::Mat& window, const TargetLook& look) {
  if (look.kind == TargetKind::colour) return colour_signal(window, look.rgb);
  cv::Mat grey;
  if (window.channels() == 3) {
    cv::cvtColor(window, grey, cv::COLOR_BGR2GRAY);
    grey.convertTo(grey, CV_32F);
  } else {
    window.convertTo(grey, CV_32F);
  }
  const float middle = median_of(sample_of(grey));
  return look.kind == TargetKind::bright ? cv::Mat(grey - middle) : cv::Mat(middle - grey);
}

/// σ of one pixel, from the differences of neighbours; texture counts as noise.
double noise_of(const cv::Mat& signal) {
  if (signal.cols < 2) return 0.0;
  cv::Mat differences = signal.colRange(1, signal.cols) - signal.colRange(0, signal.cols - 1);
  differences = cv::abs(differences);
  const double pixels_sigma = 0.5;  // rounding to whole grey values
  return std::max(pixels_sigma, normal_from_mad * median_of(sample_of(differences)) / std::sqrt(2.0));
}

struct Blob {
  cv::Rect box;
  double mass = 0.0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  ///< In the window; roughly.
};

std::vector<Blob> blobs_of(const cv::Mat& smoothed, double threshold, double max_radius_px) {
  cv::Mat labels, stats, middles;
  const int count = cv::connectedComponentsWithStats(smoothed > threshold, labels, stats, middles, 8, CV_32S);
  std::vector<Blob> blobs(static_cast<std::size_t>(count));
  for (int v = 0; v < labels.rows; ++v)
    for (int u = 0; u < labels.cols; ++u)
      blobs[static_cast<std::size_t>(labels.at<int>(v, u))].mass += static_cast<double>(smoothed.at<float>(v, u));
  constexpr int min_area_px = 3;
  std::vector<Blob> kept;
  for (int i = 1; i < count; ++i) {
    const auto stat = [&](int which) { return stats.at<int>(i, which); };
    Blob& blob = blobs[static_cast<std::size_t>(i)];
    blob.box = {stat(cv::CC_STAT_LEFT), stat(cv::CC_STAT_TOP), stat(cv::CC_STAT_WIDTH), stat(cv::CC_STAT_HEIGHT)};
    blob.px = {middles.at<double>(i, 0), middles.at<double>(i, 1)};
    if (stat(cv::CC_STAT_AREA) < min_area_px || std::max(blob.box.width, blob.box.height) > 2.0 * max_radius_px)
      continue;
    kept.push_back(blob);
  }
  std::ranges::stable_sort(kept, [](const Blob& a, const Blob& b) { return a.mass > b.mass; });
  return kept;
}

/// The blob that is meant, or the reason why it cannot be determined. The window's corner makes pixels of the image.
std::optional<Blob> choose(const std::vector<Blob>& blobs, const TargetLook& look,
                           const std::optional<Eigen::Vector2d>& expected, const Eigen::Vector2d& corner,
                           std::string& reason) {
  std::vector<Blob> alike;
  for (const Blob& blob : blobs)
    if (blob.mass >= look.rival_share * blobs.front().mass) alike.push_back(blob);
  if (alike.size() == 1) return alike.front();
  if (expected) {
    const auto off = [&](const Blob& blob) { return (blob.px - *expected).norm(); };
    std::ranges::stable_sort(alike, [&](const Blob& a, const Blob& b) { return off(a) < off(b); });
    if (off(alike[1]) > 3.0 * off(alike[0])) return alike.front();
  }
  reason = two_candidates(alike[0].px + corner, alike[1].px + corner);
  return std::nullopt;
}

/// Centroid of the area that the blob covers: pixels count by their share of its plateau, so that noise and shading
/// inside do not move it and its soft edge determines it to a fraction of a pixel.
TargetDetection measure(const cv::Mat& signal, const Blob& blob, double noise) {
  const int margin = 3;
  const cv::Rect box =
      cv::Rect(blob.box.x - margin, blob.box.y - margin, blob.box.width + 2 * margin, blob.box.height + 2 * margin) &
      cv::Rect(0, 0, signal.cols, signal.rows);
  std::vector<float> inside, around;
  for (int v = box.y; v < box.br().y; ++v) {
    for (int u = box.x; u < box.br().x; ++u)
      (blob.box.contains({u, v}) ? inside : around).push_back(signal.at<float>(v, u));
  }
  const auto top = inside.begin() + static_cast<std::ptrdiff_t>(inside.size() * 3 / 4);
  std::nth_element(inside.begin(), top, inside.end());
  const double ground = around.empty() ? 0.0 : static_cast<double>(median_of(around));
  const double contrast = std::max(1.0, static_cast<double>(*top) - ground);
  constexpr double min_share = 0.2;  // below it there is noise
  double sum = 0.0;
  Eigen::Vector2d first = Eigen::Vector2d::Zero();
  std::vector<Eigen::Vector2d> places;
  for (int v = box.y; v < box.br().y; ++v) {
    for (int u = box.x; u < box.br().x; ++u) {
      const double share = std::min(1.0, (static_cast<double>(signal.at<float>(v, u)) - ground) / contrast);
      if (share < min_share) continue;
      places.emplace_back(u, v);
      sum += share;
      first += share * places.back();
    }
  }
  TargetDetection found;
  found.px = first / sum;
  for (const Eigen::Vector2d& place : places) found.cov += (place - found.px) * (place - found.px).transpose();
  found.cov *= std::pow(noise / contrast / sum, 2);
  const double shape_px = 0.05;  // what pixels and an edge that is not quite even leave
  found.cov.diagonal().array() += shape_px * shape_px;
  found.score = std::clamp(1.0 - 6.0 * noise / contrast, 0.0, 1.0);
  found.radius_px = std::sqrt(sum / 3.141592653589793);
  return found;
}

}  // namespace

TargetDetection find_target_blob(const cv::Mat& frame, const TargetLook& look,
                                 const std::optional<TargetExpectation>& expected) {
  const double max_radius_px = look.max_radius_share * std::min(frame.rows, frame.cols);
  const SearchWindow window = search_window(frame, expected, 0.5 * max_radius_px);
  if (window.width < 8 || window.height < 8) return lost_target("out of the image");
  const cv::Mat signal = signal_of(frame({window.u, window.v, window.width, window.height}), look);
  cv::Mat smoothed;
  cv::GaussianBlur(signal, smoothed, {3, 3}, 0.8, 0.8, cv::BORDER_REPLICATE);
  const double noise = noise_of(signal);
  double peak = 0.0;
  cv::minMaxLoc(smoothed, nullptr, &peak);
  constexpr double min_contrast = 12.0;  // of 255: less is not a target that a user sees
  if (peak < std::max(look.min_snr * noise, min_contrast)) return lost_target("not in the image");
  const std::vector<Blob> blobs = blobs_of(smoothed, 0.5 * peak, max_radius_px);
  if (blobs.empty()) return lost_target("what has its look is too large");
  const Eigen::Vector2d corner = window.corner();
  std::optional<Eigen::Vector2d> expected_here;
  if (expected) expected_here = expected->px - corner;
  std::string reason;
  const std::optional<Blob> blob = choose(blobs, look, expected_here, corner, reason);
  if (!blob) return lost_target(reason);
  const cv::Rect in_frame = blob->box + cv::Point(window.u, window.v);
  if (in_frame.x <= 0 || in_frame.y <= 0 || in_frame.br().x >= frame.cols || in_frame.br().y >= frame.rows)
    return lost_target("cut off by the edge of the image");
  TargetDetection found = measure(signal, *blob, noise);
  found.px += corner;
  return found;
}

}  // namespace alidade
