#pragma once

#include <span>
#include <vector>

#include "alidade/rangefinder/checks/shot_residual.h"

namespace alidade {

/// All inputs of a solve for the beam except the initial guess.
struct BeamProblem {
  std::vector<PreparedShot> shots;
  std::span<const Eigen::Vector3d> points_in_board;
  ShotModel model;
  std::optional<double> sigma_corner_px;  ///< Replaces the corners' own covariances.
  bool estimate_scale = false;
  int max_iterations = 50;

  /// Number of free parameters of the beam: the first ones of the six.
  [[nodiscard]] int num_free() const { return estimate_scale ? 6 : 5; }
};

/// Normal equations of the laser's residuals, each whitened with its full covariance; poses and lens are fixed.
struct BeamNormals {
  BeamMatrix H = BeamMatrix::Zero();
  BeamVector g = BeamVector::Zero();
  /// Jᵀ W J_lens, poses following the lens; from beam_normals() only, not from a solution.
  Eigen::Matrix<double, num_beam_params, Eigen::Dynamic> H_lens;
  double cost = 0.0;
  int num_rows = 0;
};
[[nodiscard]] std::optional<BeamNormals> beam_normals(const BeamProblem& problem, const Camera& camera,
                                                      const Beam& beam);

struct BeamSolution {
  Beam beam;
  bool converged = false;
  BeamNormals normals;
  int iterations = 0;
};

/// Levenberg–Marquardt on the sphere of directions from `start`, with the weights updated at each step. None if the
/// initial guess has no residuals.
[[nodiscard]] std::optional<BeamSolution> solve_beam(const BeamProblem& problem, const Camera& camera,
                                                     const Beam& start);

/// Squared whitened residual of one shot; infinite if it has none.
[[nodiscard]] double shot_chi2(const PreparedShot& shot, const Beam& beam, const Camera& camera,
                               const ShotModel& model);

}  // namespace alidade
