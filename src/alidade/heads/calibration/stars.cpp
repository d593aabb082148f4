#include "alidade/heads/calibration/stars.h"
#include "alidade/geometry/decompositions.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace alidade {
namespace {

constexpr std::size_t max_stars = 150, min_pairs = 5;

/// The grey that half of the pixels are below, and how much those around it scatter.
std::pair<double, double> sky_of(const cv::Mat& grey) {
  std::array<std::size_t, 256> counts{};
  for (auto value = grey.begin<uchar>(); value != grey.end<uchar>(); ++value) ++counts[*value];
  const auto quantile = [&](double share) {
    std::size_t sum = 0, i = 0;
    const auto wanted = static_cast<std::size_t>(share * static_cast<double>(grey.total()));
    while (i < 255 && (sum += counts[i]) <= wanted) ++i;
    return static_cast<double>(i);
  };
  return {quantile(0.5), quantile(0.84) - quantile(0.5)};
}

/// The similarity that takes the pairs of `from` onto those of `to`: a, b of (a −b; b a), and the shift.
struct Similarity {
  Eigen::Vector2d turn{1.0, 0.0}, shift = Eigen::Vector2d::Zero();
  [[nodiscard]] Eigen::Vector2d operator()(const Eigen::Vector2d& p) const {
    return Eigen::Vector2d(turn[0] * p[0] - turn[1] * p[1], turn[1] * p[0] + turn[0] * p[1]) + shift;
  }
};

Similarity fitted(std::span<const Eigen::Vector2d> from, std::span<const Eigen::Vector2d> to,
                  std::span<const std::pair<std::size_t, std::size_t>> pairs) {
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  for (const auto& [i, j] : pairs) {
    Eigen::Matrix<double, 2, 4> row;
    row << from[i].x(), -from[i].y(), 1, 0, from[i].y(), from[i].x(), 0, 1;
    normal += row.transpose() * row;
    right += row.transpose() * to[j];
  }
  const Eigen::Vector4d solution = solve_symmetric(normal, right);
  return {solution.head<2>(), solution.tail<2>()};
}

/// Each star of `to` at most once, by the nearest.
std::vector<std::pair<std::size_t, std::size_t>> paired(std::span<const Eigen::Vector2d> from,
                                                        std::span<const Eigen::Vector2d> to,
                                                        const Similarity& similarity, double near_px) {
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Eigen::Vector2d there = similarity(from[i]);
    std::size_t best = to.size(), within = 0;
    for (std::size_t j = 0; j < to.size(); ++j) {
      const double away = (to[j] - there).norm();
      within += away < 2.0 * near_px;
      if (away < near_px) best = j;
    }
    if (best < to.size() && within == 1) pairs.emplace_back(i, best);  // two that are near could be exchanged
  }
  return pairs;
}

/// The shift that most pairs have about in common; none: a second one has nearly as many.
std::optional<Eigen::Vector2d> voted(std::span<const Eigen::Vector2d> from, std::span<const Eigen::Vector2d> to) {
  constexpr double cell_px = 5.0;
  std::map<std::pair<int, int>, int> votes;
  for (const Eigen::Vector2d& a : from)
    for (const Eigen::Vector2d& b : to)
      ++votes[{static_cast<int>(std::floor((b - a).x() / cell_px)),
               static_cast<int>(std::floor((b - a).y() / cell_px))}];
  const auto around = [&](const std::pair<int, int>& cell) {
    int sum = 0;
    for (int x = -1; x <= 1; ++x)
      for (int y = -1; y <= 1; ++y)
        if (const auto found = votes.find({cell.first + x, cell.second + y}); found != votes.end())
          sum += found->second;
    return sum;
  };
  std::pair<int, int> best{0, 0};
  int most = 0, second = 0;
  for (const auto& [cell, count] : votes)
    if (const int sum = around(cell); sum > most) {
      most = sum;
      best = cell;
    }
  for (const auto& [cell, count] : votes)
    if (std::max(std::abs(cell.first - best.first), std::abs(cell.second - best.second)) > 2)
      second = std::max(second, around(cell));
  constexpr int clearly = 2;
  if (most < static_cast<int>(min_pairs) || most < clearly * second) return std::nullopt;
  return Eigen::Vector2d(cell_px * (best.first + 0.5), cell_px * (best.second + 0.5));
}

}  // namespace

std::vector<Eigen::Vector2d> find_stars(const cv::Mat& grey) {
  constexpr double sigmas = 6.0, least = 12.0;
  constexpr int largest_px = 400;
  const auto [sky, scatter] = sky_of(grey);
  const cv::Mat bright = grey > sky + std::max(least, sigmas * scatter);
  cv::Mat labels, stats, centroids;
  const int count = cv::connectedComponentsWithStats(bright, labels, stats, centroids, 8);
  std::vector<std::pair<double, Eigen::Vector2d>> found;
  for (int k = 1; k < count; ++k) {
    const int* box = stats.ptr<int>(k);
    if (box[cv::CC_STAT_AREA] > largest_px) continue;
    double sum = 0.0;
    Eigen::Vector2d moment = Eigen::Vector2d::Zero();
    for (int y = box[cv::CC_STAT_TOP]; y < box[cv::CC_STAT_TOP] + box[cv::CC_STAT_HEIGHT]; ++y)
      for (int x = box[cv::CC_STAT_LEFT]; x < box[cv::CC_STAT_LEFT] + box[cv::CC_STAT_WIDTH]; ++x) {
        if (labels.at<int>(y, x) != k) continue;
        const double light = grey.at<uchar>(y, x) - sky;
        sum += light;
        moment += light * Eigen::Vector2d(x, y);
      }
    found.emplace_back(sum, moment / sum);
  }
  std::ranges::stable_sort(found, [](const auto& a, const auto& b) { return a.first > b.first; });
  found.resize(std::min(found.size(), max_stars));
  std::vector<Eigen::Vector2d> stars;
  for (const auto& [sum, px] : found) stars.push_back(px);
  return stars;
}

std::optional<StarShift> shift_of_stars(std::span<const Eigen::Vector2d> from, std::span<const Eigen::Vector2d> to) {
  constexpr double coarse_px = 8.0, fine_px = 2.5;
  const auto shift = voted(from, to);
  if (!shift) return std::nullopt;
  Similarity similarity{{1.0, 0.0}, *shift};
  std::vector<std::pair<std::size_t, std::size_t>> pairs = paired(from, to, similarity, coarse_px);
  for (int round = 0; round < 2; ++round) {
    if (pairs.size() < min_pairs) return std::nullopt;
    similarity = fitted(from, to, pairs);
    pairs = paired(from, to, similarity, fine_px);
  }
  if (pairs.size() < min_pairs) return std::nullopt;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& star : from) centre += star / static_cast<double>(from.size());
  return StarShift{similarity(centre) - centre, std::move(pairs)};
}

std::vector<TrackedPoint> StarTracks::update(std::vector<Eigen::Vector2d> stars, const Eigen::Vector2d& pan_tilt_rad) {
  constexpr std::size_t near = 4;
  std::vector<std::size_t> nearest(images_.size());
  std::iota(nearest.begin(), nearest.end(), 0);
  std::ranges::stable_sort(nearest, {}, [&](std::size_t i) { return (images_[i].pan_tilt_rad - pan_tilt_rad).norm(); });
  nearest.resize(std::min(nearest.size(), near));
  std::vector<int> ids(stars.size(), -1);
  for (const std::size_t k : nearest) {
    const auto shift = shift_of_stars(images_[k].stars, stars);
    if (!shift) continue;
    for (const auto& [i, j] : shift->pairs) {
      const int id = images_[k].ids[i];
      if (ids[j] < 0 && std::ranges::find(ids, id) == ids.end()) ids[j] = id;
    }
  }
  if (!images_.empty() && std::ranges::all_of(ids, [](int id) { return id < 0; })) return {};
  std::vector<TrackedPoint> points;
  for (std::size_t j = 0; j < stars.size(); ++j) {
    if (ids[j] < 0) ids[j] = next_id_++;
    points.push_back({ids[j], stars[j]});
  }
  images_.push_back({pan_tilt_rad, std::move(stars), std::move(ids)});
  return points;
}

std::optional<StarShift> StarTracks::last_shift() const {
  if (images_.size() < 2) return std::nullopt;
  return shift_of_stars(images_[images_.size() - 2].stars, images_.back().stars);
}

}  // namespace alidade
