#pragma once

#include <Eigen/Core>

#include "alidade/reproduce/paper_report.h"

namespace alidade::reproduce {

/// Where the target starts. [cm]
inline const Eigen::Vector3d paper_target_cm(17.3, -31.4, 63.6);

/// Angles, position and baseline at the start.
[[nodiscard]] Experiment xiahou_geometry();
/// The filter in the paper's own simulation: figures 4 and 5.
[[nodiscard]] Experiment xiahou_tracking(const ReproduceConfig& config);
/// The same filter and ours on rigs as they are built.
[[nodiscard]] Experiment xiahou_realistic(const ReproduceConfig& config);
/// The loop as figure 2 prints it: what is fed back is the projected estimate.
[[nodiscard]] Experiment xiahou_loop(const ReproduceConfig& config);
/// The servo loop with measured pixels.
[[nodiscard]] Experiment xiahou_servo(const ReproduceConfig& config);

}  // namespace alidade::reproduce
