#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "alidade/track/tracker.h"

namespace alidade {

/// Position and velocity of the target at each observation.
using TargetPath = std::vector<Eigen::Vector<double, 6>>;

/// What observations say of the parameters p of all heads (the rows of each one's RigUncertainty::factor, one head
/// after the other), linearised along one path, the path eliminated: −2 ln p = cost − 2 gᵀ p + pᵀ information p.
struct PathEquations {
  Eigen::MatrixXd information;
  Eigen::VectorXd g;
  Eigen::VectorXd seen;        ///< The diagonal of the information if the path were known.
  double cost = 0.0;           ///< At p = 0.
  double expected_cost = 0.0;  ///< Of a right rig, the noise being as stated and the path smooth.
};

/// The path of the model cv by the tracker's σ_a that suits the observations best, which are in order of capture; it
/// begins with where their rays meet. None where too few of them do.
[[nodiscard]] std::optional<TargetPath> smooth_path(std::span<const TargetObservation> observations,
                                                    std::span<const RigHead> heads, const TrackerConfig& config);

/// About that path the target may go anywhere: its velocity changes by white noise of a σ_a of `free_m_s2`.
[[nodiscard]] PathEquations path_equations(std::span<const TargetObservation> observations,
                                           std::span<const RigHead> heads,
                                           std::span<const Eigen::Vector<double, 6>> path, const TrackerConfig& config,
                                           double free_m_s2);

}  // namespace alidade
