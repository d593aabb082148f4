#pragma once

#include "alidade/rangefinder/solve/beam_solve.h"

namespace alidade {

/// What may move of the lens, and how far: the parameters that its covariance leaves free, with the information that
/// this covariance is about them.
struct LensPrior {
  std::vector<int> free;
  Eigen::VectorXd mean;         ///< Of all parameters.
  Eigen::MatrixXd information;  ///< Of the free ones; where the covariance is singular, 10¹⁰ times the rest.
};
/// Nothing is free where the covariance is not known. `with_distortion` false: at most fx, fy, cx, cy.
[[nodiscard]] LensPrior lens_prior(const Camera& camera, bool with_distortion);

/// Normal equations over [beam (5 or 6), free lens parameters] and the pose of each board that has corners. Residuals:
/// corners, readings, spots, and the prior of the lens. Wang & Li 2020, eq. (14) and (16), whitened.
struct CommonSystem {
  using Whitener = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3>;
  struct ShotBlock {
    bool has_pose = false;
    Eigen::Matrix<double, 6, 6> V = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, Eigen::Dynamic> W;  ///< Pose by common.
    Eigen::Matrix<double, 6, 1> g = Eigen::Matrix<double, 6, 1>::Zero();
    Whitener whitener;
  };
  Eigen::MatrixXd U;
  Eigen::VectorXd g;
  std::vector<ShotBlock> blocks;  ///< One per shot.
  double cost = 0.0;
  double cost_with_old_weights = 0.0;
  int num_residuals = 0;

  /// Schur complement over the poses, U − Σ Wᵀ V⁻¹ W: the information about the shared parameters.
  [[nodiscard]] Eigen::MatrixXd information() const;
};

/// Where the solve stands. Shots without corners have no pose here.
struct CommonState {
  Beam beam;
  Camera camera;
  std::vector<std::optional<Rigid3>> cam_from_board;
};

/// The shot with its plane where the board now is; the pose is a parameter, not a measurement. None: as it is.
[[nodiscard]] PreparedShot at_state(const PreparedShot& shot, const std::optional<Rigid3>& cam_from_board);

/// None where a corner or spot is not seen or a plane not met. `old`: whiteners for cost_with_old_weights.
[[nodiscard]] std::optional<CommonSystem> common_system(const BeamProblem& problem, const LensPrior& prior,
                                                        const CommonState& state, const CommonSystem* old = nullptr);

struct RefinedBeam {
  CommonState state;    ///< Beam and camera with covariance.
  CommonSystem system;  ///< At the state.
  std::vector<std::optional<BoardPose>> poses;
  int num_parameters = 0;
  bool converged = false;
  int iterations = 0;
};

/// Levenberg–Marquardt over everything, poses eliminated. None where the start has no residuals or the information is
/// singular. `max_iterations` 0: covariances at the start.
[[nodiscard]] std::optional<RefinedBeam> refine_all(const BeamProblem& problem, const LensPrior& prior,
                                                    const CommonState& start, int max_iterations);

}  // namespace alidade
