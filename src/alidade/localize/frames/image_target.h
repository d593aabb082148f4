#pragma once

#include <optional>
#include <vector>

#include "alidade/localize/known_pose.h"

namespace cv {
class Mat;
}

namespace alidade {

/// The target in an image: where its points are, and from where it looks so.
struct SeenTarget {
  std::vector<FeatureObservation> observations;
  std::vector<StartHypothesis> starts;  ///< The better one first.
  std::size_t num_alike = 1;            ///< Things in the image that might as well be the target.
};

/// None where it is not found, or where what is found does not have its shape. Of several rectangles with its shape the
/// one of most contrast and least pattern inside; `num_alike` counts those elsewhere that are nearly as good.
[[nodiscard]] std::optional<SeenTarget> find_target(const cv::Mat& grey, const Camera& camera,
                                                    const LocalizeTarget& target, const KnownPoseConfig& config);

}  // namespace alidade
