#pragma once

#include <optional>
#include <span>

#include "alidade/calibrate/calibrate.h"
#include "alidade/estimation/verdict.h"

namespace alidade {

/// Boards, or the camera, that move while an image's rows are read, differently in each photo. Of the same motion in
/// all photos: ModelErrors.
struct ReadoutMotion {
  double sheared_px = 0.0;  ///< RMS over the corners of all photos of what the motion displaces and no pose does.
  double before_px = 0.0;   ///< RMS of a corner's coordinate about the fit, by its degrees of freedom.
  double after_px = 0.0;    ///< The same with a motion for each photo.
};

/// The motion where it explains most of what the fit leaves, and more than a focal length or a centre of each photo's
/// own would: linear in the row (three translations and a turn about the board's normal), lens and poses following, to
/// first order. None where it explains less, where it does in less than half of the photos (those of another lens are
/// sheared, too), for fewer than six photos or a camera behind a port. `views`: as for calibrate().
[[nodiscard]] std::optional<ReadoutMotion> readout_motion(std::span<const BoardView> views,
                                                          const CalibrateReport& report);

/// Names it in a verdict that is of care or worse.
void heed_readout_motion(const ReadoutMotion& motion, Verdict& verdict);

}  // namespace alidade
