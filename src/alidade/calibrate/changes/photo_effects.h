#pragma once

#include <optional>
#include <span>
#include <string>

#include "alidade/calibrate/calibrate.h"
#include "alidade/calibrate/checks/view_scores.h"
#include "alidade/estimation/verdict.h"

namespace alidade {

/// What of the lens differs from photo to photo without any order: the centre, as of an image stabiliser, or the focal
/// length, as of an autofocus that searches.
struct PhotoEffect {
  bool is_centre = false;
  double scatter = 0.0;  ///< σ over the photos: of cx and cy [px], or of the focal length, relative.
  double before = 0.0;   ///< Mean square of what the photos say of the other lens parameters, in the noise's; 1: noise.
  double after = 0.0;    ///< The same once each photo has its own.
};

/// The effect that explains why the photos disagree: with a centre (or focal length) of its own in each, eliminated to
/// first order, they agree on the other lens parameters within the noise of their corners. None where they agree as
/// they are, where neither explains it, or for fewer than eight photos.
[[nodiscard]] std::optional<PhotoEffect> photo_effect(std::span<const ViewScore> views, const CalibrateReport& report);

/// Names it in the verdict, which is of care at best.
void heed_photo_effect(const PhotoEffect& effect, Verdict& verdict);

}  // namespace alidade
