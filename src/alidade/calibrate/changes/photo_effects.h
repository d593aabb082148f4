#pragma once

#include <optional>
#include <span>
#include <string>

#include "alidade/calibrate/calibrate.h"
#include "alidade/calibrate/checks/view_scores.h"
#include "alidade/estimation/verdict.h"

namespace alidade {

/// A property of the lens that differs from photo to photo at random: the centre, as with an image stabiliser, or the
/// focal length, as with a hunting autofocus.
struct PhotoEffect {
  bool is_centre = false;
  double scatter = 0.0;  ///< σ over the photos: of cx and cy [px], or of the focal length, relative.
  double before = 0.0;   ///< Mean square deviation of the photos' other lens parameters, over that of noise; 1: noise.
  double after = 0.0;    ///< The same with a value per photo.
};

/// The effect that explains why the photos disagree: with a centre (or focal length) for each photo, eliminated to
/// first order, they agree on the other lens parameters within the noise of their corners. None if they agree without
/// it, if neither explains the disagreement, or for fewer than eight photos.
[[nodiscard]] std::optional<PhotoEffect> photo_effect(std::span<const ViewScore> views, const CalibrateReport& report);

/// Reports it in the verdict, which becomes `care` at best.
void heed_photo_effect(const PhotoEffect& effect, Verdict& verdict);

}  // namespace alidade
