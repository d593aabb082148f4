#pragma once

#include <limits>
#include <string>
#include <vector>

#include "alidade/pantilt/head.h"
#include "alidade/pantilt/target_observation.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// σ of a head's encoder zeros and scales (not the noise of readings), from a file; NaN: not given, 0: exact.
struct EncoderError {
  double sigma_zero_rad = std::numeric_limits<double>::quiet_NaN();
  double sigma_scale = std::numeric_limits<double>::quiet_NaN();
};

/// One or more heads in one world frame: what `alidade rig` estimates and rig.yaml contains.
struct Rig {
  std::vector<RigHead> heads;
  /// Covariance of the parameters of all heads, head by head, each in the order of head_param_names (zero rows if
  /// fixed); 0×0 if unknown, all zero if the heads are exact.
  Eigen::MatrixXd cov;
  /// The same followed by the parameters of all lenses, head by head: the joint covariance of the heads and the lenses
  /// they were calibrated with. 0×0 if unknown; the covariance of each lens is then that of its own camera.
  Eigen::MatrixXd cov_with_lenses;
  std::vector<EncoderError> encoder_errors;             ///< One per head, or none.
  std::vector<IntrinsicsHistory> intrinsics_histories;  ///< For zooming cameras: one per head, or none.
  /// What read_rig() found to differ from the time of the calibration: results based on this rig are not reliable.
  std::vector<std::string> doubts;
};

/// What to do about Rig::doubts.
inline constexpr const char* rig_doubts_remedy =
    "calibrate the rig again with that camera (alidade rig); or, if it is meant, remove camera_values of that head";

/// What is wrong with a head or a rig built by a program, in one sentence; empty if nothing is wrong.
[[nodiscard]] std::string fault(const RigHead& rig_head);
[[nodiscard]] std::string fault(const Rig& rig);

/// Names of the parameters of all heads, in the order of `cov`: "head1.base_x_m", …
[[nodiscard]] std::vector<std::string> parameter_names(const Rig& rig);

ALIDADE_PUBLIC_END
}  // namespace alidade
