#pragma once

#include "alidade/localize/config.h"

namespace cv {
class Mat;
}

namespace alidade {

/// Where a patch lies wholly where the scene is shown; of no size: everywhere.
struct ShownPart {
  ImageMask mask;
  bool lacks_circle = false;  ///< One was asked for, and `grey` shows none.
};

/// Of a circle the smallest around all that is not dark in `grey`: it is one where it leaves something of the image
/// out, and is filled.
[[nodiscard]] ShownPart shown_part(const LocalizeConfig& config, const cv::Mat& grey, int margin_px);

}  // namespace alidade
