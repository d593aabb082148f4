#pragma once

#include <Eigen/Core>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// J_r with exp(φ + ε) ≈ exp(φ) exp(J_r ε): I − (1 − cos θ)/θ² [φ]× + (θ − sin θ)/θ³ [φ]×².
/// Solà, Deray & Atchuthan, "A micro Lie theory", 2018, eq. (143).
[[nodiscard]] Eigen::Matrix3d right_jacobian(const Eigen::Vector3d& phi);

ALIDADE_PUBLIC_END
}  // namespace alidade
