#pragma once

#include <Eigen/Core>
#include <complex>

#include "alidade/pantilt/servo_plant.h"

namespace alidade {

/// One axis within its limits, with its command delay and second lag, exact from sample to sample:
/// x_{k+1} = A x_k + now u_{k−n} + before u_{k−n−1}; state x = (angle [rad], rate [rad/s], command behind the lag).
struct SampledAxis {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d now = Eigen::Vector3d::Zero(), before = Eigen::Vector3d::Zero();
  int delay_samples = 0;  ///< n: delay in whole periods.

  /// Transfer function angle / command at z, without the n periods.
  [[nodiscard]] std::complex<double> response(std::complex<double> z) const;
};
[[nodiscard]] SampledAxis sampled_with_delay(const ServoAxis& axis, double period_s);

}  // namespace alidade
