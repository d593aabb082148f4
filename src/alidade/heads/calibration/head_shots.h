#pragma once

#include "alidade/heads/head_calibrate.h"

namespace alidade {

/// The same for a camera that exposes one picture after the other, as a telescope's does: the head goes from place to
/// place and rests, stars are found in each picture, and again in the next by how they lie. How large a step is in the
/// image, and how the image is turned, is learnt by small ones. Throws InputError, Interrupted.
void calibrate_by_shots(MovingHead& head, FrameStream& stream, const HeadCalibrationConfig& config,
                        const Progress& progress, HeadCalibration& result);

}  // namespace alidade
