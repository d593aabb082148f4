#pragma once

#include "alidade/rangefinder/solve/beam_solve.h"

namespace alidade {

/// The free parameters of the lens and their prior: those that its covariance leaves free, with the corresponding
/// information.
struct LensPrior {
  std::vector<int> free;
  Eigen::VectorXd mean;         ///< Over all parameters.
  Eigen::MatrixXd information;  ///< Over the free ones; in singular directions, 10¹⁰ times the rest.
};
/// No parameter is free if the covariance is unknown. `with_distortion` false: at most fx, fy, cx, cy.
[[nodiscard]] LensPrior lens_prior(const Camera& camera, bool with_distortion);

/// Normal equations over [beam (5 or 6), free lens parameters] and the pose of each board that has corners. Residuals:
/// corners, readings, spots, and the prior of the lens. Wang & Li 2020, eq. (14) and (16), whitened.
struct CommonSystem {
  using Whitener = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3>;
  struct ShotBlock {
    bool has_pose = false;
    Eigen::Matrix<double, 6, 6> V = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, Eigen::Dynamic> W;  ///< Pose × shared parameters.
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

/// State of the solve. Shots without corners have no pose here.
struct CommonState {
  Beam beam;
  Camera camera;
  std::vector<std::optional<Rigid3>> cam_from_board;
};

/// The shot with its plane at the current board pose, which is a parameter, not a measurement. None: unchanged.
[[nodiscard]] PreparedShot at_state(const PreparedShot& shot, const std::optional<Rigid3>& cam_from_board);

/// None if a corner or spot is not visible or a plane not intersected. `old`: whiteners for cost_with_old_weights.
[[nodiscard]] std::optional<CommonSystem> common_system(const BeamProblem& problem, const LensPrior& prior,
                                                        const CommonState& state, const CommonSystem* old = nullptr);

struct RefinedBeam {
  CommonState state;    ///< Beam and camera with covariance.
  CommonSystem system;  ///< At `state`.
  std::vector<std::optional<BoardPose>> poses;
  int num_parameters = 0;
  bool converged = false;
  int iterations = 0;
};

/// Levenberg–Marquardt over all parameters, poses eliminated. None if the initial guess has no residuals or the
/// information is singular. `max_iterations` 0: covariances at the initial guess.
[[nodiscard]] std::optional<RefinedBeam> refine_all(const BeamProblem& problem, const LensPrior& prior,
                                                    const CommonState& start, int max_iterations);

}  // namespace alidade
