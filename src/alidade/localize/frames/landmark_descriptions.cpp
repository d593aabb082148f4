#include "alidade/localize/frames/landmark_descriptions.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <map>
#include <opencv2/features2d.hpp>

namespace alidade {
namespace {

constexpr int num_levels = 5, num_corners = 700, edge_px = 19, patch_px = 31, fast_threshold = 12;
constexpr float level_scale = 1.2F;
constexpr std::array<int, 2> described_levels{0, 3};  // landmarks are found at 0.6 to 2 times the distance
/// Of 256 bits: descriptors of different points differ in 128 ± 20 bits or so.
constexpr int max_differing = 56;

cv::Ptr<cv::ORB> describer() {
  return cv::ORB::create(num_corners, level_scale, num_levels, edge_px, 0, 2, cv::ORB::HARRIS_SCORE, patch_px,
                         fast_threshold);
}

}  // namespace

void LandmarkDescriptions::add(const cv::Mat& grey, std::size_t frame, std::span<const LandmarkSeen> landmarks) {
  std::vector<cv::KeyPoint> points;
  for (std::size_t i = 0; i < landmarks.size(); ++i)
    for (const int level : described_levels) {
      const float size = patch_px * std::pow(level_scale, static_cast<float>(level));
      points.emplace_back(static_cast<float>(landmarks[i].px.x()), static_cast<float>(landmarks[i].px.y()), size, 0.0F,
                          1.0F, level, static_cast<int>(i));
    }
  cv::Mat rows;
  describer()->compute(grey, points, rows);
  Image image{frame, {}};
  for (std::size_t i = 0; i < points.size(); ++i) {
    Described described{landmarks[static_cast<std::size_t>(points[i].class_id)].id, {}};
    std::memcpy(described.descriptor.data(), rows.ptr(static_cast<int>(i)), sizeof(Descriptor));
    image.landmarks.push_back(described);
  }
  images_.push_back(std::move(image));
  if (images_.size() <= max_images) return;
  std::size_t num = 0;
  std::erase_if(images_, [&](const Image&) { return num++ % 2 == 1; });
}

std::vector<LandmarkDescriptions::Corner> LandmarkDescriptions::corners_of(const cv::Mat& grey) {
  std::vector<cv::KeyPoint> points;
  cv::Mat rows;
  const cv::Ptr<cv::ORB> orb = describer();
  orb->detect(grey, points);
  for (cv::KeyPoint& point : points) point.angle = 0.0F;
  orb->compute(grey, points, rows);
  std::vector<Corner> corners(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    corners[i].px = {points[i].pt.x, points[i].pt.y};
    std::memcpy(corners[i].descriptor.data(), rows.ptr(static_cast<int>(i)), sizeof(Descriptor));
  }
  return corners;
}

/// Matches each landmark with its most similar corner, if no other landmark is more similar to that corner.
std::vector<LandmarkSeen> LandmarkDescriptions::matched(const Image& image, std::span<const Corner> corners) {
  struct Nearest {
    int differing = max_differing + 1;
    std::size_t at = 0;
  };
  std::map<long, Nearest> of_landmark;
  std::vector<std::pair<int, long>> of_corner(corners.size(), {max_differing + 1, 0});
  for (const Described& landmark : image.landmarks) {
    Nearest& nearest = of_landmark[landmark.id];
    for (std::size_t i = 0; i < corners.size(); ++i) {
      int differing = 0;
      for (std::size_t k = 0; k < landmark.descriptor.size(); ++k)
        differing += std::popcount(landmark.descriptor[k] ^ corners[i].descriptor[k]);
      if (differing < nearest.differing) nearest = {differing, i};
      if (differing < of_corner[i].first) of_corner[i] = {differing, landmark.id};
    }
  }
  std::vector<LandmarkSeen> seen;
  for (const auto& [id, nearest] : of_landmark)
    if (nearest.differing <= max_differing && of_corner[nearest.at].second == id)
      seen.push_back({id, corners[nearest.at].px});
  return seen;
}

std::vector<std::vector<LandmarkSeen>> LandmarkDescriptions::matches(const cv::Mat& grey, std::size_t before,
                                                                     std::size_t least, std::size_t most) const {
  std::vector<std::vector<LandmarkSeen>> all;
  if (images_.empty() || images_.front().frame >= before) return all;
  const std::vector<Corner> corners = corners_of(grey);
  for (const Image& image : images_) {
    if (image.frame >= before) break;
    std::vector<LandmarkSeen> seen = matched(image, corners);
    if (seen.size() >= least) all.push_back(std::move(seen));
  }
  std::ranges::stable_sort(all, std::greater{}, &std::vector<LandmarkSeen>::size);
  if (all.size() > most) all.resize(most);
  return all;
}

}  // namespace alidade
