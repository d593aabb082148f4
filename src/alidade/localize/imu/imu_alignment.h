#pragma once

#include <span>
#include <vector>

#include "alidade/imu/imu.h"
#include "alidade/localize/imu/imu_estimate.h"
#include "alidade/localize/sequence.h"

namespace alidade {

/// Initial alignment of an IMU with a path of unknown scale or in metres; or the fault of its readings. Clock offset
/// and mounting rotation from both angular rates (W. Kabsch, "A solution for the best rotation to relate two sets of
/// vectors", Acta Cryst. A32, 1976); then scale, gravity and force bias by linear least squares over steps of a quarter
/// of a second (as T. Qin et al., "VINS-Mono", TRO 34(4), 2018, §V.B, but for the inverse of the scale, whose
/// coefficients are from the IMU and hardly noisy).
struct ImuAlignment {
  ImuEstimate estimate;  ///< scale, late_s, mounting, biases in the camera's axes, gravity; σ of the scale.
  std::vector<ImuReading> readings;  ///< In the camera's axes and on its clock.
};
[[nodiscard]] ImuAlignment align_imu(const Imu& imu, std::span<const TimedPose> path);

/// Longest gap in the readings that is bridged.
[[nodiscard]] double max_imu_gap_s(std::span<const ImuReading> readings);

}  // namespace alidade
