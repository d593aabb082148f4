#pragma once

#include <Eigen/Core>

#include "alidade/estimation/progress.h"
#include "alidade/matching/matched_photos.h"

namespace alidade {

/// Two photos whose matches agree on one homography, as those of a rotating camera do: H = K_b R K_a⁻¹.
struct PhotoLink {
  int photo_a = 0, photo_b = 0;
  std::size_t pair = 0;                                    ///< In MatchedPhotos::pairs.
  std::vector<int> inliers;                                ///< Of the pair's matches.
  Eigen::Matrix3d b_from_a = Eigen::Matrix3d::Identity();  ///< The homography, normalised pixels.
  bool is_same_image = false;                              ///< Every point is where it was.
};

/// Normalised pixels: centre of the image 0, half its width 1.
struct PhotoScale {
  double half_width_px = 1.0;
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  explicit PhotoScale(const MatchedPhotos& photos)
      : half_width_px(0.5 * photos.width_px), centre_px(0.5 * (photos.width_px - 1), 0.5 * (photos.height_px - 1)) {}
  [[nodiscard]] Eigen::Vector2d normalised(const Eigen::Vector2d& px) const { return (px - centre_px) / half_width_px; }
};

/// The consistent pairs: at least eight matches, and a tenth of them, agree. Brown & Lowe, "Automatic panoramic
/// image stitching using invariant features", 2007, section 3. Throws Interrupted.
[[nodiscard]] std::vector<PhotoLink> find_links(const MatchedPhotos& photos, const Progress& progress = {});

/// The largest set of photos that links join, with no link through the same image twice; the photo with most links
/// first, the others in the order of a tree of the strongest links. `link_of[i]`: the link by which photo i joins one
/// before it; −1 for the first.
struct PhotoTree {
  std::vector<int> photos, link_of;
};
[[nodiscard]] PhotoTree largest_tree(std::size_t num_photos, const std::vector<PhotoLink>& links);

}  // namespace alidade
