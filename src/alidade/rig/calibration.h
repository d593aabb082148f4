#pragma once

#include <string>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/public.h"
#include "alidade/rig/report.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The result of rig(): what the solve found (rig, boards, views …), with its covariance, counts and
/// verdict.
struct RigCalibration : RigReport {
  std::vector<HeadView> measured;  ///< One a stop, with the corners of its photos; `views` says what became of each.
  std::vector<SkippedInput> no_board;       ///< Photos that show no board, or cannot be used; in `counts.skipped`, too.
  std::vector<SkippedInput> unreadable;     ///< Of these, photos that cannot be used.
  std::vector<SkippedInput> wrong_corners;  ///< Of views that are used without them; in `counts.skipped`, too.
  std::vector<SkippedInput> repeated;       ///< Views averaged with the first of their stop; in `counts.skipped`, too.
  RigConfig config;
  Eigen::MatrixXd covariance;                ///< Of all heads: rig.cov.
  std::vector<std::string> parameter_names;  ///< Of `covariance`: "head1.base_x_m", …
  Counts counts;                             ///< Of views.
  Verdict verdict;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
