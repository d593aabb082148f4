#pragma once

#include <memory>

#include "alidade/localize/config.h"

namespace cv {
class Mat;
}

namespace alidade {

/// Detects parts of the images that never move while the scene does: a burnt-in clock, the rim of a round image, the
/// vehicle itself. An edge stands still if it is unchanged while most edges of the image move; one that does so nine
/// times in ten is not part of the scene.
class StillParts {
 public:
  StillParts();
  ~StillParts();
  StillParts(StillParts&&) noexcept;
  StillParts& operator=(StillParts&&) noexcept;

  /// Adds the next image, smoothed. Returns whether the still parts changed.
  bool add(const cv::Mat& smoothed);
  /// Zero where nothing should be searched: still edges, dilated by `margin_px`. Size of the images.
  [[nodiscard]] cv::Mat shown(int margin_px) const;
  /// Fraction of the image, without margin.
  [[nodiscard]] double still_share() const;

 private:
  struct Counts;
  std::unique_ptr<Counts> counts_;
};

}  // namespace alidade
