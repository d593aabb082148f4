#pragma once

#include "alidade/turned/photo_links.h"

namespace alidade {

/// A local optimum of the focal length, at which the links are most like rotations, and each link's rotation there.
struct FocalStart {
  double focal = 1.0;   ///< fx, normalised; the principal point is at the image centre.
  double aspect = 1.0;  ///< fy / fx.
  double cost = 0.0;    ///< Mean of truncated squares over the links' points.
  std::vector<Eigen::Matrix3d> b_from_a;
};

/// All minima over the focal length, from 0.25 to 60 half widths, in order of increasing cost, at most `most`. All
/// links have equal weight. The one-parameter search of Stein, "Accurate internal camera calibration using rotation",
/// 1995, without its measured angles.
[[nodiscard]] std::vector<FocalStart> focal_starts(const MatchedPhotos& photos, const std::vector<PhotoLink>& links,
                                                   double aspect = 1.0, std::size_t most = 3);

/// The links' rotations for a given focal length.
[[nodiscard]] FocalStart start_at(double focal, const MatchedPhotos& photos, const std::vector<PhotoLink>& links,
                                  double aspect);

/// The aspect fy / fx for which the links agree better than for square pixels, as in a squeezed image, or apparently if
/// the lens distorts; 1: none.
[[nodiscard]] double likely_aspect(const MatchedPhotos& photos, const std::vector<PhotoLink>& links);

/// Ratio of the focal length of b to that of a (`focal`), by a link's homography: K_b R = H K_a, whose rows have the
/// lengths f_b, aspect × f_b and 1.
[[nodiscard]] double zoom_of(const PhotoLink& link, double focal, double aspect);

}  // namespace alidade
