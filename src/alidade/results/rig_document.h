#pragma once

#include <span>

#include "alidade/results/result_document.h"
#include "alidade/rig/rig.h"

namespace alidade {

/// Puts a rig into a result: heads, chi2_per_dof, rms_px, noise, covers, the covariance, and the views as a table.
void fill_rig(std::span<const HeadView> views, const RigReport& report, ResultDocument& document);

/// The heads alone, with their σ and covariance.
void fill_heads(const Rig& rig, ResultDocument& document);

/// Their σ if every single measurement erred by itself: `stddev_model`.
void fill_heads_model(const Rig& rig, const Eigen::MatrixXd& cov_model, ResultDocument& document);

}  // namespace alidade
