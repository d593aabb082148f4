#pragma once

#include "alidade/localize/config.h"

namespace cv {
class Mat;
}

namespace alidade {

/// Where a patch lies wholly where the scene is shown; of no size: everywhere. Of a circle the
/// smallest around all that is not dark in `grey`.
[[nodiscard]] ImageMask shown_part(const LocalizeConfig& config, const cv::Mat& grey, int margin_px);

}  // namespace alidade
