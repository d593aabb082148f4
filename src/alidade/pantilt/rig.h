#pragma once

#include <vector>

#include "alidade/pantilt/head.h"

namespace alidade {

/// One head or more in one world: what `alidade rig` estimates and rig.yaml holds.
struct Rig {
  std::vector<RigHead> heads;
  /// Covariance of the parameters of all heads, one head after the other, each as head_param_names (what is held has
  /// zero rows); 0×0 where unknown.
  Eigen::MatrixXd cov;
};

}  // namespace alidade
