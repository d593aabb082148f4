#include "alidade/turned/photo_links.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

namespace alidade {
namespace {

constexpr std::size_t min_inliers = 8;
constexpr double min_share = 0.1;
constexpr double agree_within = 0.0022, agree_within_px = 1.5;  // of the width; for distortion and hand motion
constexpr double same_within_px = 0.05;

/// The homography on which most matches of a pair agree.
PhotoLink link_of_pair(const MatchedPhotos& photos, std::size_t index) {
  const MatchedPair& pair = photos.pairs[index];
  PhotoLink link{pair.photo_a, pair.photo_b, index, {}, Eigen::Matrix3d::Identity(), false};
  if (pair.matches.size() < min_inliers) return link;
  const PhotoScale scale(photos);
  std::vector<cv::Point2d> a, b;
  std::size_t still = 0;
  for (const FeatureMatch& match : pair.matches) {
    const Eigen::Vector2d at_a =
        photos.features[static_cast<std::size_t>(pair.photo_a)][static_cast<std::size_t>(match.a)];
    const Eigen::Vector2d at_b =
        photos.features[static_cast<std::size_t>(pair.photo_b)][static_cast<std::size_t>(match.b)];
    const Eigen::Vector2d qa = scale.normalised(at_a), qb = scale.normalised(at_b);
    a.emplace_back(qa.x(), qa.y());
    b.emplace_back(qb.x(), qb.y());
    still += (at_a - at_b).norm() < same_within_px ? 1u : 0u;
  }
  const double threshold = std::max(agree_within * photos.width_px, agree_within_px) / scale.half_width_px;
  std::vector<unsigned char> fits;
  cv::Mat H;
  try {
    H = cv::findHomography(a, b, cv::RANSAC, threshold, fits, 4000, 0.9995);
  } catch (const cv::Exception&) {
    return link;  // collinear points
  }
  if (H.empty()) return link;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) link.b_from_a(i, j) = H.at<double>(i, j);
  }
  for (std::size_t i = 0; i < fits.size(); ++i) {
    if (fits[i]) link.inliers.push_back(static_cast<int>(i));
  }
  const auto share = static_cast<double>(link.inliers.size()) / static_cast<double>(pair.matches.size());
  if (link.inliers.size() < min_inliers || share < min_share) link.inliers.clear();
  constexpr double nearly_all = 0.8;
  link.is_same_image = static_cast<double>(still) > nearly_all * static_cast<double>(pair.matches.size());
  return link;
}

}  // namespace

std::vector<PhotoLink> find_links(const MatchedPhotos& photos, const Progress& progress) {
  std::vector<PhotoLink> links(photos.pairs.size());
  std::atomic<std::size_t> done = 0;
  tbb::parallel_for(std::size_t{0}, links.size(), [&](std::size_t i) {
    links[i] = link_of_pair(photos, i);
    report_progress(progress, "pairs", ++done, links.size());
  });
  std::erase_if(links, [](const PhotoLink& link) { return link.inliers.empty(); });
  return links;
}

PhotoTree largest_tree(std::size_t num_photos, const std::vector<PhotoLink>& links) {
  std::vector<std::size_t> strength(num_photos, 0);
  for (const PhotoLink& link : links) {
    strength[static_cast<std::size_t>(link.photo_a)] += link.inliers.size();
    strength[static_cast<std::size_t>(link.photo_b)] += link.inliers.size();
  }
  PhotoTree largest;
  std::vector<bool> is_done(num_photos, false);
  for (;;) {
    int root = -1;
    for (std::size_t k = 0; k < num_photos; ++k) {
      const bool is_stronger = root < 0 || strength[k] > strength[static_cast<std::size_t>(root)];
      if (!is_done[k] && is_stronger) root = static_cast<int>(k);
    }
    if (root < 0) break;
    PhotoTree tree{{root}, {-1}};
    is_done[static_cast<std::size_t>(root)] = true;
    for (;;) {  // Prim's algorithm: the strongest link that leads out
      int best = -1;
      for (std::size_t i = 0; i < links.size(); ++i) {
        const auto inside = [&](int photo) { return std::ranges::find(tree.photos, photo) != tree.photos.end(); };
        if (inside(links[i].photo_a) == inside(links[i].photo_b)) continue;
        const bool is_better =
            best < 0 || links[i].inliers.size() > links[static_cast<std::size_t>(best)].inliers.size();
        if (is_better) best = static_cast<int>(i);
      }
      if (best < 0) break;
      const PhotoLink& link = links[static_cast<std::size_t>(best)];
      const bool has_a = std::ranges::find(tree.photos, link.photo_a) != tree.photos.end();
      tree.photos.push_back(has_a ? link.photo_b : link.photo_a);
      tree.link_of.push_back(best);
      is_done[static_cast<std::size_t>(tree.photos.back())] = true;
    }
    if (tree.photos.size() > largest.photos.size()) largest = std::move(tree);
  }
  return largest;
}

}  // namespace alidade
