#pragma once

#include <limits>
#include <string>
#include <vector>

#include "alidade/pantilt/head.h"
#include "alidade/pantilt/target_observation.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// σ of a head's encoders beside its readings' noise, where a file gives it; NaN: not given, 0: exact.
struct EncoderError {
  double sigma_zero_rad = std::numeric_limits<double>::quiet_NaN();
  double sigma_scale = std::numeric_limits<double>::quiet_NaN();
};

/// One head or more in one world: what `alidade rig` estimates and rig.yaml holds.
struct Rig {
  std::vector<RigHead> heads;
  /// Covariance of the parameters of all heads, one head after the other, each as head_param_names (what is fixed has
  /// zero rows); 0×0 where unknown, all zero where the heads are exact.
  Eigen::MatrixXd cov;
  /// The same followed by the parameters of all lenses, head by head: what the heads share with the lenses that they
  /// were calibrated through. 0×0 where that is not known; each lens then has its own camera's covariance.
  Eigen::MatrixXd cov_with_lenses;
  std::vector<EncoderError> encoder_errors;             ///< One per head, or none.
  std::vector<IntrinsicsHistory> intrinsics_histories;  ///< One per head, or none: of cameras that zoom.
  /// What read_rig() found that is not as it was when the rig was calibrated: no answer by it is good.
  std::vector<std::string> doubts;
};

/// What to do about a rig's doubts.
inline constexpr const char* rig_doubts_remedy =
    "calibrate the rig again with that camera (alidade rig); or, if it is meant, remove camera_values of that head";

/// What is wrong with a head or a rig that a program made, in one sentence; empty where nothing is.
[[nodiscard]] std::string fault(const RigHead& rig_head);
[[nodiscard]] std::string fault(const Rig& rig);

/// Names of the parameters of all heads, in the order of `cov`: "head1.base_x_m", …
[[nodiscard]] std::vector<std::string> parameter_names(const Rig& rig);

ALIDADE_PUBLIC_END
}  // namespace alidade
