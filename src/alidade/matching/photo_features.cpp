#include "alidade/matching/photo_features.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <set>
#include <stdexcept>
#include <string>

#include "alidade/imaging/grey_photo.h"

namespace alidade {
namespace {

/// 8-bit grey image of at most `max_megapixels`; `shrunk` is its size over the photo's.
cv::Mat small_grey(const cv::Mat& photo, double max_megapixels, double& shrunk) {
  std::string reason;
  cv::Mat grey = to_grey_photo(photo, reason);
  if (grey.empty()) throw std::invalid_argument(reason);
  grey.convertTo(grey, CV_8U);
  const double pixels = static_cast<double>(grey.total());
  shrunk = std::min(1.0, std::sqrt(max_megapixels * 1e6 / pixels));
  if (shrunk < 1.0) cv::resize(grey, grey, {}, shrunk, shrunk, cv::INTER_AREA);
  return grey;
}

/// The strongest in each cell of a grid, one per position.
std::vector<cv::KeyPoint> spread(std::vector<cv::KeyPoint> found, const cv::Size& size, int most) {
  constexpr int columns = 8, rows = 6;
  std::stable_sort(found.begin(), found.end(),
                   [](const cv::KeyPoint& a, const cv::KeyPoint& b) { return a.response > b.response; });
  std::vector<int> taken(columns * rows, 0);
  std::set<std::pair<float, float>> places;
  std::vector<cv::KeyPoint> kept;
  for (const cv::KeyPoint& point : found) {
    const int column =
        std::clamp(static_cast<int>(point.pt.x * columns / static_cast<float>(size.width)), 0, columns - 1);
    const int row = std::clamp(static_cast<int>(point.pt.y * rows / static_cast<float>(size.height)), 0, rows - 1);
    int& in_cell = taken[static_cast<std::size_t>(row * columns + column)];
    if (in_cell >= most / (columns * rows) || !places.emplace(point.pt.x, point.pt.y).second) continue;
    ++in_cell;
    kept.push_back(point);
  }
  return kept;
}

/// Offset of positions from OpenCV's SIFT, which are too large by this: it doubles the image about the outer borders of
/// the pixels, and halves the positions found there about the centre of the first pixel.
constexpr double sift_shift_px = 0.25;

}  // namespace

PhotoFeatures find_features(const cv::Mat& photo, const FeatureConfig& config) {
  double shrunk = 1.0;
  const cv::Mat grey = small_grey(photo, config.max_megapixels, shrunk);
  const auto sift = cv::SIFT::create(0, 3, 0.025);
  std::vector<cv::KeyPoint> found;
  sift->detect(grey, found);
  std::vector<cv::KeyPoint> kept = spread(std::move(found), grey.size(), config.max_features);
  cv::Mat descriptors;
  if (!kept.empty()) sift->compute(grey, kept, descriptors);
  PhotoFeatures features;
  features.descriptors.resize(descriptors.rows, descriptors.cols);
  for (int i = 0; i < descriptors.rows; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const Eigen::Array2d seen = Eigen::Array2d(kept[at].pt.x, kept[at].pt.y) - sift_shift_px;
    features.px.emplace_back((seen + 0.5) / shrunk - 0.5);
    const Eigen::Map<const Eigen::RowVectorXf> values(descriptors.ptr<float>(i), descriptors.cols);
    features.descriptors.row(i) = (values / std::max(values.sum(), 1e-6F)).cwiseMax(0.0F).cwiseSqrt();
  }
  return features;
}

std::vector<FeatureMatch> match_features(const Descriptors& a, const Descriptors& b, double ratio) {
  std::vector<FeatureMatch> matches;
  if (a.rows() < 2 || b.rows() < 2) return matches;
  constexpr Eigen::Index strip = 256;  // rows at a time: the product of all would be large
  std::vector<int> nearest_of_a(static_cast<std::size_t>(a.rows()), -1),
      nearest_of_b(static_cast<std::size_t>(b.rows()), -1);
  Eigen::VectorXf best_of_b = Eigen::VectorXf::Constant(b.rows(), -1.0F);
  for (Eigen::Index first = 0; first < a.rows(); first += strip) {
    const Eigen::Index count = std::min(strip, a.rows() - first);
    const Descriptors alike = a.middleRows(first, count) * b.transpose();
    for (Eigen::Index i = 0; i < count; ++i) {
      float best = -1.0F, second = -1.0F;
      int at = -1;
      for (Eigen::Index j = 0; j < b.rows(); ++j) {
        const float value = alike(i, j);
        if (value > best_of_b[j]) {
          best_of_b[j] = value;
          nearest_of_b[static_cast<std::size_t>(j)] = static_cast<int>(first + i);
        }
        if (value > best) {
          second = best;
          best = value;
          at = static_cast<int>(j);
        } else if (value > second) {
          second = value;
        }
      }
      // for unit vectors: distance² = 2 − 2 · similarity
      const double nearest = std::max(2.0 - 2.0 * best, 0.0), next = std::max(2.0 - 2.0 * second, 0.0);
      if (nearest < ratio * ratio * next) nearest_of_a[static_cast<std::size_t>(first + i)] = at;
    }
  }
  for (std::size_t i = 0; i < nearest_of_a.size(); ++i) {
    const int j = nearest_of_a[i];
    if (j >= 0 && nearest_of_b[static_cast<std::size_t>(j)] == static_cast<int>(i))
      matches.push_back({static_cast<int>(i), j});
  }
  return matches;
}

}  // namespace alidade
