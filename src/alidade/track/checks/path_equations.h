#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "alidade/track/tracker.h"

namespace alidade {

/// Position and velocity of the target at each observation.
using TargetPath = std::vector<Eigen::Vector<double, 6>>;

/// Information of the observations about the parameters p of all heads (the rows of each RigUncertainty::factor, head
/// by head), linearised along one path, the path eliminated: −2 ln p = cost − 2 gᵀ p + pᵀ information p.
struct PathEquations {
  Eigen::MatrixXd information;
  Eigen::VectorXd g;
  Eigen::VectorXd seen;        ///< Diagonal of the information if the path were known.
  double cost = 0.0;           ///< At p = 0.
  double expected_cost = 0.0;  ///< For a correct rig, with the stated noise and a smooth path.
};

/// The most probable path of model cv with the tracker's σ_a for these observations, which are in order of capture; the
/// initial path is the intersection of their rays. None if too few of them intersect.
[[nodiscard]] std::optional<TargetPath> smooth_path(std::span<const TargetObservation> observations,
                                                    std::span<const RigHead> heads, const TrackerConfig& config);

/// The target may deviate from that path: its velocity changes by white noise of intensity σ_a `free_m_s2`.
[[nodiscard]] PathEquations path_equations(std::span<const TargetObservation> observations,
                                           std::span<const RigHead> heads,
                                           std::span<const Eigen::Vector<double, 6>> path, const TrackerConfig& config,
                                           double free_m_s2);

}  // namespace alidade
