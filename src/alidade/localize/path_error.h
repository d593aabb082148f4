#pragma once

#include <limits>
#include <span>
#include <vector>

#include "alidade/geometry/rigid3.h"
#include "alidade/geometry/similarity.h"

namespace alidade {

/// A pose at a time.
struct TimedPose {
  double t_s = 0.0;
  Rigid3 world_from_cam;
};

/// How far an estimated path is from the true one. Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM
/// Systems", IROS 2012: ATE is the RMS distance of positions after alignment; RPE the RMS translation of
/// (Q_i⁻¹ Q_i+1)⁻¹ (P_i⁻¹ P_i+1) between neighbours, with the aligned scale.
struct PathError {
  double ate_m = std::numeric_limits<double>::quiet_NaN();
  double rpe_m = std::numeric_limits<double>::quiet_NaN();
  double rpe_rad = std::numeric_limits<double>::quiet_NaN();  ///< RMS rotation of the same.
  double unaligned_m = std::numeric_limits<double>::quiet_NaN();
  double scale = 1.0;  ///< Of truth over estimate.
  std::size_t num_pairs = 0;
};

/// Each estimated pose is compared with the true one of its time (within `tolerance_s`).
[[nodiscard]] PathError path_error(std::span<const TimedPose> estimated, std::span<const TimedPose> truth,
                                   bool is_rigid, double tolerance_s = 0.01);

}  // namespace alidade
