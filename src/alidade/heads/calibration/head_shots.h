#pragma once

#include "alidade/heads/head_calibrate.h"

namespace alidade {

/// The same for a camera that exposes one image after the other, as a telescope's does: the head goes from position to
/// position and rests, stars are found in each image, and again in the next by how they lie. How large a step is in the
/// image, and how the image is rotated, is measured by small ones. Throws InputError, Interrupted.
void calibrate_by_shots(MovingHead& head, FrameStream& stream, const HeadCalibrationConfig& config,
                        const Progress& progress, HeadCalibration& result);

}  // namespace alidade
