#pragma once

#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/turned/turned_model.h"

namespace alidade {

/// One point observed in one photo.
struct TurnedDetection {
  int photo = 0, track = 0;
  Eigen::Vector2d px;  ///< Normalised.
};

/// Photos of a rotating camera, adjusted jointly. The observations are ordered by track.
struct TurnedBundle {
  TurnedCamera camera;
  std::vector<Eigen::Matrix3d> cam_from_world;  ///< One per photo. The first is fixed, as the world's rotation is free.
  std::vector<double> log_zoom;                 ///< One per photo; the first is fixed.
  std::vector<Eigen::Vector3d> rays;            ///< One per track, unit length, in the world.
  std::vector<TurnedDetection> observations;
};

/// The rotation from one photo's camera to another's.
[[nodiscard]] inline Eigen::Matrix3d turn_between(const TurnedBundle& bundle, std::size_t from, std::size_t to) {
  const Eigen::Matrix3d world_from_cam = bundle.cam_from_world[from].transpose();
  return bundle.cam_from_world[to] * world_from_cam;
}

/// Prior of the camera, a normal distribution about `mean`.
struct TurnedPrior {
  TurnedCamera mean = TurnedCamera::Zero();
  TurnedInformation information = TurnedInformation::Zero();
  double zoom_information = 1e12;  ///< 1/σ² of each photo's log zoom; large: all photos have the same zoom.
};

struct TurnedSolveConfig {
  double sigma_px = 1e-3;  ///< σ of a coordinate, normalised.
  double huber = 2.0;      ///< Huber threshold, in σ of a residual.
  int max_iterations = 50;
  double min_gain = 1e-8;  ///< Relative decrease of the cost below which the iteration ends.
};

/// Normal equations of camera and photos, with the tracks' rays eliminated. Order: camera, then `per_photo` per photo.
struct TurnedNormal {
  Eigen::MatrixXd information;
  Eigen::VectorXd gradient;
};

/// Normal equations at the values of `bundle`, in units of 1/σ²; without the observations of `without_photo`, if
/// given.
[[nodiscard]] TurnedNormal turned_normal(const TurnedBundle& bundle, const TurnedPrior& prior,
                                         const TurnedSolveConfig& config, int without_photo = -1);

struct TurnedSolution {
  bool converged = false;
  int iterations = 0;
  double cost = 0.0;  ///< Huber's cost, with the prior, for the given σ.
  std::vector<Eigen::Vector2d>
      residuals;  ///< Prediction minus pixel, one per observation, normalised; NaN where there is none.
};

/// Levenberg–Marquardt on camera, rotations (and zooms) and rays, in place; rays are eliminated track by track. Throws
/// Interrupted. Triggs et al., "Bundle adjustment — a modern synthesis", 2000, section 6.
TurnedSolution solve_turned(TurnedBundle& bundle, const TurnedPrior& prior, const TurnedSolveConfig& config,
                            const Progress& progress = {});

/// Each observation's residual over √(1 − 1/m), the share that a track of m observations leaves of an error. NaN as in
/// `residuals`.
[[nodiscard]] std::vector<double> freed_norms(const TurnedBundle& bundle,
                                              const std::vector<Eigen::Vector2d>& residuals);

}  // namespace alidade
