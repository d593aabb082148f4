#pragma once

#include <functional>
#include <string>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/matching/matched_photos.h"
#include "alidade/matching/photo_features.h"

namespace alidade {

/// What photos show alike, and why some show nothing.
struct PhotoMatches {
  MatchedPhotos photos;              ///< One entry a photo; of the size that most photos have.
  std::vector<std::string> reasons;  ///< One per photo: why it has no features; empty where it has.
  std::size_t num_unreadable = 0;
};

/// Features of all photos, on all cores that TBB is allowed, and their matches, each pair of photos. Photos of another
/// size than most are rejected and named. `load_photo` is called from several threads; what it throws becomes the
/// photo's reason. Throws Interrupted.
[[nodiscard]] PhotoMatches match_photos(const std::vector<std::string>& names,
                                        const std::function<cv::Mat(std::size_t)>& load_photo,
                                        const FeatureConfig& config = {}, const Progress& progress = {});

}  // namespace alidade
