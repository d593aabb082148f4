#pragma once

#include <Eigen/Core>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// What was expected of a measurement before it was used: innovation ν = z − h(x) and its covariance S.
struct Innovation {
  Eigen::Vector2d nu = Eigen::Vector2d::Zero();
  Eigen::Matrix2d S = Eigen::Matrix2d::Identity();
  double nis = 0.0;  ///< νᵀ S⁻¹ ν: χ² with 2 degrees of freedom where the models hold.
};

ALIDADE_PUBLIC_END
}  // namespace alidade
