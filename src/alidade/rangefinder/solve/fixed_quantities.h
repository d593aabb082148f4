#pragma once

#include "alidade/rangefinder/rangefinder.h"
#include "alidade/rangefinder/solve/reduced_system.h"

namespace alidade {

/// Quantities that a solve fixed. `places`: indices of its parameters in the system; `inverse`: of their
/// information.
struct SolvedPart {
  std::vector<Eigen::Index> places;
  Eigen::MatrixXd inverse;
};

/// ∂cost/2 with respect to all parameters of the system, including the lens prior; `camera`: the current one.
[[nodiscard]] Eigen::VectorXd gradient_of(const ReducedSystem& system, const LensPrior& prior, const Camera& camera);

/// Square and scale, focal length, centre and fixed distortion, flatness of the board: effect of each on the beam,
/// and its score test. `camera`: as given. C. R. Rao, Proc. Cambridge Phil. Soc. 44, 1948 (the score test).
[[nodiscard]] std::vector<FixedQuantity> fixed_quantities(const ReducedSystem& system, const SolvedPart& part,
                                                          const LensPrior& prior, const Camera& camera,
                                                          std::span<const Eigen::Vector3d> points_in_board,
                                                          const RangefinderReport& report,
                                                          const RangefinderConfig& config);

/// The same for the σ of readings and spots: effect on the beam of another value, lens and poses fixed.
[[nodiscard]] std::vector<FixedQuantity> fixed_sigmas(const BeamProblem& problem, const RangefinderReport& report);

}  // namespace alidade
