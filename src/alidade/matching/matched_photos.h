#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Two features matched as the same point: their indices in the feature lists of their photos.
struct FeatureMatch {
  int a = 0, b = 0;
};

struct MatchedPair {
  int photo_a = 0, photo_b = 0;
  std::vector<FeatureMatch> matches;
};

/// Features of photos of one size, and matches between them. Any number of the matches may be wrong.
struct MatchedPhotos {
  int width_px = 0, height_px = 0;                     ///< Size of all photos that have features.
  std::vector<std::string> names;                      ///< One per photo.
  std::vector<std::vector<Eigen::Vector2d>> features;  ///< [px]
  std::vector<MatchedPair> pairs;                      ///< Each pair of photos once, a before b.
};

ALIDADE_PUBLIC_END
}  // namespace alidade
