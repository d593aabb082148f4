#pragma once

#include <optional>
#include <vector>

#include "alidade/localize/known_pose.h"

namespace cv {
class Mat;
}

namespace alidade {

/// The target in an image: observations of its points, and camera poses from them.
struct SeenTarget {
  std::vector<FeatureObservation> observations;
  std::vector<StartHypothesis> starts;  ///< The better one first.
  std::size_t num_alike = 1;            ///< Number of things in the image that may equally be the target.
};

/// Empty if it is not found, or if what is found does not have its shape. Of several rectangles with its shape, selects
/// the one with most contrast and least texture inside; `num_alike` counts those elsewhere that are nearly as good.
[[nodiscard]] std::optional<SeenTarget> find_target(const cv::Mat& grey, const Camera& camera,
                                                    const LocalizeTarget& target, const KnownPoseConfig& config);

}  // namespace alidade
