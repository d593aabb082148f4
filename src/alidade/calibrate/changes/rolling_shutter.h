#pragma once

#include <optional>
#include <span>

#include "alidade/calibrate/calibrate.h"
#include "alidade/estimation/verdict.h"

namespace alidade {

/// Boards, or the camera, move while the rows of an image are read, differently in each photo. For the same motion in
/// all photos see ModelErrors.
struct ReadoutMotion {
  double sheared_px = 0.0;  ///< RMS displacement of all corners by the motion, without what a pose absorbs.
  double before_px = 0.0;   ///< RMS residual of a corner's coordinate, by degrees of freedom.
  double after_px = 0.0;    ///< The same with an estimated motion per photo.
};

/// The motion, if it explains most of the residuals, and more than a separate focal length or centre for each photo
/// would: linear in the row (three translations and a rotation about the board's normal), lens and poses following, to
/// first order. None if it explains less, if it does so in less than half of the photos (photos by another lens appear
/// sheared, too), for fewer than six photos or a camera behind a port. `views`: as for calibrate().
[[nodiscard]] std::optional<ReadoutMotion> readout_motion(std::span<const BoardView> views,
                                                          const CalibrateReport& report);

/// Reports it in a verdict that is `care` or worse.
void heed_readout_motion(const ReadoutMotion& motion, Verdict& verdict);

}  // namespace alidade
