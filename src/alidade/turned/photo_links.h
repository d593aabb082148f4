#pragma once

#include <Eigen/Core>

#include "alidade/estimation/progress.h"
#include "alidade/matching/matched_photos.h"

namespace alidade {

/// Two photos whose matches agree with one homography, as for a rotating camera: H = K_b R K_a⁻¹.
struct PhotoLink {
  int photo_a = 0, photo_b = 0;
  std::size_t pair = 0;                                    ///< Index in MatchedPhotos::pairs.
  std::vector<int> inliers;                                ///< Indices of the pair's matches.
  Eigen::Matrix3d b_from_a = Eigen::Matrix3d::Identity();  ///< The homography, in normalised pixels.
  bool is_same_image = false;                              ///< No point moves between the photos.
};

/// Normalisation of pixels: the image's centre is 0, half its width is 1.
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

/// The largest set of photos that links connect, with no link through the same image twice; first the photo with the
/// most links, then the others in the order of a tree of the strongest links. `link_of[i]` is the link that connects
/// photo i to an earlier one; −1 for the first.
struct PhotoTree {
  std::vector<int> photos, link_of;
};
[[nodiscard]] PhotoTree largest_tree(std::size_t num_photos, const std::vector<PhotoLink>& links);

}  // namespace alidade
