#pragma once

#include <span>
#include <string>
#include <vector>

#include "alidade/calibrate/calibrate.h"
#include "alidade/calibrate/solve/bundle.h"

namespace alidade {

/// The user's request in the form that the solver takes: skew is fixed unless it is freed, and what is known of a port
/// is added to the fixed parameters.
[[nodiscard]] CalibrateConfig resolved(CalibrateConfig config);

/// All faults of `config`, one sentence each; empty if it is usable.
[[nodiscard]] std::vector<std::string> faults(const CalibrateConfig& config);

/// What is wrong if more than one corner in ten lies outside the images, whose size then is another one, or if all lie
/// within a few pixels; or empty.
[[nodiscard]] std::string outside_fault(std::span<const BoardView> views, const ImageSize& size);

/// Number of usable views needed: three, or two if the principal point is fixed (Zhang 2000, §3.1).
[[nodiscard]] std::size_t min_views(const CalibrateConfig& config);

/// Sets free parameters, priors and board of `problem`; returns the lens with every fixed parameter at its value: that
/// of its prior, else the image centre (cx, cy), else zero. `config` must have no faults.
[[nodiscard]] Lens set_up_problem(const Board& board, const CalibrateConfig& config, ImageSize size,
                                  BundleProblem& problem);

/// Number of unknowns besides the poses.
[[nodiscard]] int num_unknown_globals(const BundleProblem& problem);

/// σ of each board point's z [m] from the covariance of the globals; empty for a flat or given board.
[[nodiscard]] std::vector<double> shape_sigma_z(const BundleProblem& problem, const Eigen::MatrixXd& cov,
                                                double variance_scale);

/// The parameters that dominate a direction of the globals, for a user: "fx, fy and the distances of the boards".
[[nodiscard]] std::string name_combination(const BundleProblem& problem, const Lens& lens,
                                           const Eigen::VectorXd& direction);

}  // namespace alidade
