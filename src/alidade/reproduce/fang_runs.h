#pragma once

#include <string>
#include <vector>

#include "alidade/reproduce/fang_scenes.h"
#include "alidade/reproduce/paper_report.h"

namespace alidade::reproduce {

/// One estimator's way through a log.
struct FangRun {
  std::vector<IntrinsicsEstimate> estimates;
  std::vector<double> error_px;  ///< RMS over the first six states' errors after each row; of the observer alone.
  std::vector<std::vector<double>> errors_px;  ///< The six themselves, one list a state.
};
/// The paper's observer with a profile's gain; `planned`: Ḡ of the same points and motion.
[[nodiscard]] FangRun run_observer(const RotationLog& log, FangProfile profile, const RotationLog& planned);
/// Our default.
[[nodiscard]] FangRun run_hybrid(const RotationLog& log);

/// The time from which on the RMS of the six errors stays below `limit_px`.
[[nodiscard]] double errors_settle_s(const RotationLog& log, const FangRun& run, double limit_px);

/// The points of the figures: far apart, as in the paper's.
[[nodiscard]] std::vector<Eigen::Vector2d> figure_points();
[[nodiscard]] RotationLog clean_log(const std::vector<Eigen::Vector2d>& points);

/// Figure of the six errors, and of the intrinsics against time: by the paper's method, by ours, and the truth.
[[nodiscard]] FigureTable errors_figure(const std::string& id, const RotationLog& log, const FangRun& ours);
[[nodiscard]] FigureTable intrinsics_figure(const std::string& id, const RotationLog& log, const FangRun& ours,
                                            const FangRun& best);

/// What is said to be enough: how many points and of what kind, and which motion.
[[nodiscard]] Experiment fang_conditions(const ReproduceConfig& config);

}  // namespace alidade::reproduce
