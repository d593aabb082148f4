#pragma once

#include "alidade/project.h"
#include "alidade/public.h"
#include "alidade/results/outcome.h"

namespace cv {
class Mat;
}

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Result document and printed lines of a rangefinder's projected readings, and points.csv.
[[nodiscard]] JobOutcome outcome_of(const BeamProjection& projection);

/// Result document and printed lines of a rig's projected heads.
[[nodiscard]] JobOutcome outcome_of(const RigProjection& projection);

ALIDADE_PUBLIC_END

/// Adds overlay.png: a photo of the camera with the line of the beam, from 0.1 m to beyond the farthest range, and each
/// spot with its 3σ ellipse.
void add_overlay(const BeamProjection& projection, const cv::Mat& photo, JobOutcome& outcome);

}  // namespace alidade
