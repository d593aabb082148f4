#pragma once

#include "alidade/project.h"
#include "alidade/public.h"
#include "alidade/results/outcome.h"

namespace cv {
class Mat;
}

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The document of readings of a rangefinder, its lines, and points.csv.
[[nodiscard]] JobOutcome outcome_of(const BeamProjection& projection);

/// The document of a rig's heads and its lines.
[[nodiscard]] JobOutcome outcome_of(const RigProjection& projection);

ALIDADE_PUBLIC_END

/// Adds overlay.png: a photo of the camera with the beam's line from 0.1 m to beyond the farthest range, and each spot
/// with its 3σ ellipse.
void add_overlay(const BeamProjection& projection, const cv::Mat& photo, JobOutcome& outcome);

}  // namespace alidade
