#pragma once

#include "alidade/localize/config.h"

namespace cv {
class Mat;
}

namespace alidade {

/// Mask of the positions at which a patch lies completely within the scene; size 0: everywhere.
struct ShownPart {
  ImageMask mask;
  bool lacks_circle = false;  ///< A circle was requested, and `grey` shows none.
};

/// For a circle, the smallest one around all that is not dark in `grey`: valid if it excludes part of the image and is
/// filled.
[[nodiscard]] ShownPart shown_part(const LocalizeConfig& config, const cv::Mat& grey, int margin_px);

}  // namespace alidade
