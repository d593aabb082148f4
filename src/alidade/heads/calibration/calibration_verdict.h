#pragma once

#include <Eigen/Core>

#include "alidade/heads/head_calibrate.h"

namespace alidade {

/// Which focal length is not known as well as was asked, and why not. `span_rad`: what pan and tilt were allowed.
[[nodiscard]] Verdict calibration_verdict(const HeadCalibration& result, const HeadCalibrationConfig& config,
                                          const Eigen::Vector2d& span_rad);

}  // namespace alidade
