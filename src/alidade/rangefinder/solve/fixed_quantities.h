#pragma once

#include "alidade/rangefinder/rangefinder.h"
#include "alidade/rangefinder/solve/reduced_system.h"

namespace alidade {

/// What a solve fixed and took as given. `places`: indices of its parameters in the system; `inverse`: of their
/// information.
struct SolvedPart {
  std::vector<Eigen::Index> places;
  Eigen::MatrixXd inverse;
};

/// ∂cost/2 by all parameters of the system, with what the lens' prior pulls; `camera`: as it stands.
[[nodiscard]] Eigen::VectorXd gradient_of(const ReducedSystem& system, const LensPrior& prior, const Camera& camera);

/// Square and scale, focal length, centre and fixed distortion, flatness of the board: by how much each moves the beam,
/// and its score test. `camera`: as given. C. R. Rao, Proc. Cambridge Phil. Soc. 44, 1948 (the score test).
[[nodiscard]] std::vector<FixedQuantity> fixed_quantities(const ReducedSystem& system, const SolvedPart& part,
                                                          const LensPrior& prior, const Camera& camera,
                                                          std::span<const Eigen::Vector3d> points_in_board,
                                                          const RangefinderReport& report,
                                                          const RangefinderConfig& config);

/// The σ of readings and spots: what the beam does where they are another, lens and poses fixed.
[[nodiscard]] std::vector<FixedQuantity> fixed_sigmas(const BeamProblem& problem, const RangefinderReport& report);

}  // namespace alidade
