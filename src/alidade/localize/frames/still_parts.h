#pragma once

#include <memory>

#include "alidade/localize/config.h"

namespace cv {
class Mat;
}

namespace alidade {

/// What of the images never moves while the scene does: a burnt-in clock, the rim of a round image, the vehicle itself.
/// An edge that is where it was, while most edges of the image are not, stands still; what does so nine times in ten
/// does not show the scene.
class StillParts {
 public:
  StillParts();
  ~StillParts();
  StillParts(StillParts&&) noexcept;
  StillParts& operator=(StillParts&&) noexcept;

  /// The next image, smoothed. Whether the parts are others than before.
  bool add(const cv::Mat& smoothed);
  /// Black where nothing is to be looked for: still edges with `margin_px` around. Of the images' size.
  [[nodiscard]] cv::Mat shown(int margin_px) const;
  /// Of the image, without margin.
  [[nodiscard]] double still_share() const;

 private:
  struct Counts;
  std::unique_ptr<Counts> counts_;
};

}  // namespace alidade
