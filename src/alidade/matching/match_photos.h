#pragma once

#include <functional>
#include <string>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/matching/matched_photos.h"
#include "alidade/matching/photo_features.h"

namespace alidade {

/// Matches between photos, and why some photos have no features.
struct PhotoMatches {
  MatchedPhotos photos;              ///< One entry per photo; of the size that most photos have.
  std::vector<std::string> reasons;  ///< One per photo: why it has no features; empty if it has some.
  std::size_t num_unreadable = 0;
};

/// Features of all photos, on all cores that TBB may use, and the matches of every pair of photos. Photos of another
/// size than most are rejected and listed. `load_photo` is called from several threads; an exception from it becomes
/// the photo's reason. Throws Interrupted.
[[nodiscard]] PhotoMatches match_photos(const std::vector<std::string>& names,
                                        const std::function<cv::Mat(std::size_t)>& load_photo,
                                        const FeatureConfig& config = {}, const Progress& progress = {});

}  // namespace alidade
