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
  /// RMS of the positions' stated σ (root of the trace), with the aligned scale: what `ate_m` should not be above, as
  /// an alignment takes errors away and adds none.
  double stated_m = std::numeric_limits<double>::quiet_NaN();
  std::size_t num_pairs = 0;
};

constexpr double same_time_s = 0.01;

/// The pose nearest in time, or null where none is within `tolerance_s`. `poses` in order of time.
[[nodiscard]] const TimedPose* nearest_pose(std::span<const TimedPose> poses, double t_s,
                                            double tolerance_s = same_time_s);

/// Each estimated pose is compared with the true one of its time. `sigmas_m`: σ of each estimated position, or empty.
[[nodiscard]] PathError path_error(std::span<const TimedPose> estimated, std::span<const TimedPose> truth,
                                   bool is_rigid, std::span<const double> sigmas_m = {});

}  // namespace alidade
