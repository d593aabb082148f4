#pragma once

#include <string>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/public.h"
#include "alidade/rig/report.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The result of rig(): what was estimated (rig, boards, views …), with its covariance, counts and
/// verdict.
struct RigCalibration : RigReport {
  std::vector<HeadView> measured;        ///< One per stop, with the corners from its photos; see `views` for their use.
  std::vector<SkippedInput> no_board;    ///< Photos without a board, or unusable; also in `counts.skipped`.
  std::vector<SkippedInput> unreadable;  ///< Those of them that are unusable.
  std::vector<SkippedInput> wrong_corners;  ///< Rejected corners of used views; also in `counts.skipped`.
  std::vector<SkippedInput> repeated;  ///< Views averaged with the first view of their stop; also in `counts.skipped`.
  RigConfig config;
  Eigen::MatrixXd covariance;                ///< Of all heads; equals rig.cov.
  std::vector<std::string> parameter_names;  ///< Of `covariance`: "head1.base_x_m", …
  Counts counts;                             ///< Number of views.
  Verdict verdict;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
