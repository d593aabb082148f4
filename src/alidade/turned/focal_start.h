#pragma once

#include "alidade/turned/photo_links.h"

namespace alidade {

/// A focal length at which the links are most like rotations, among its neighbours, and each link's rotation there.
struct FocalStart {
  double focal = 1.0;   ///< Of x, normalised; principal point at the image centre.
  double aspect = 1.0;  ///< fy / fx.
  double cost = 0.0;    ///< Mean of truncated squares over the links' points.
  std::vector<Eigen::Matrix3d> b_from_a;
};

/// All minima over the focal length, from 0.25 to 60 half widths, the lowest first, at most `most`. Each link counts
/// alike. The one-parameter search of Stein, "Accurate internal camera calibration using rotation", 1995, without its
/// measured angles.
[[nodiscard]] std::vector<FocalStart> focal_starts(const MatchedPhotos& photos, const std::vector<PhotoLink>& links,
                                                   double aspect = 1.0, std::size_t most = 3);

/// The links' rotations at one focal length.
[[nodiscard]] FocalStart start_at(double focal, const MatchedPhotos& photos, const std::vector<PhotoLink>& links,
                                  double aspect);

/// fy / fx by which the links agree better than by square pixels, as those of a squeezed image do, or seem to where the
/// lens distorts; 1: none.
[[nodiscard]] double likely_aspect(const MatchedPhotos& photos, const std::vector<PhotoLink>& links);

/// Focal length of b over that of a, by a link's homography, if a's is `focal`: K_b R = H K_a, whose rows have lengths
/// f_b, aspect × f_b and 1.
[[nodiscard]] double zoom_of(const PhotoLink& link, double focal, double aspect);

}  // namespace alidade
