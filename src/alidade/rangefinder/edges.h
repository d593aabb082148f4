#pragma once

#include <string>
#include <vector>

#include "alidade/beam/beam.h"
#include "alidade/estimation/counts.h"
#include "alidade/estimation/verdict.h"
#include "alidade/imaging/grey_image.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// One reading of a rangefinder that rotates with the camera on a head; angles as in pantilt/head_rotation.h.
struct ScanRow {
  double pan_rad = 0.0, tilt_rad = 0.0;
  double range_m = 0.0;
};

struct EdgesConfig {
  double jump_m = 0.15;                              ///< Between neighbours of the scan: an edge of something.
  std::vector<double> blur_px = {25.0, 10.0, 5.0};   ///< Of the image's edges, coarse to fine.
  double photo_pan_rad = 0.0, photo_tilt_rad = 0.0;  ///< Where the head stood when the photo was taken.
  int max_evaluations = 600;                         ///< For each blur.
  Beam initial_guess = {};                           ///< Along the view, where nothing nearer is known.
};

/// What is wrong with the config, one sentence each; empty where it is usable.
[[nodiscard]] std::vector<std::string> faults(const EdgesConfig& config);

struct EdgesReport {
  /// Its direction is of use; the origin is known to centimetres. The covariance includes the scatter between parts of
  /// the scene, and the prior that keeps the origin near the initial guess, whose error the direction absorbs.
  Beam beam;
  int num_edges = 0;               ///< In the scan.
  double gain = 0.0;               ///< Mean log of the image's edge density at the scan's edges over a uniform one.
  double halves_differ_rad = 0.0;  ///< Direction from one half of the edges against the other's.
};

/// The result of rangefinder_by_edges(); its verdict is never better than care.
struct EdgesCalibration : EdgesReport {
  Camera camera;               ///< As given.
  Eigen::MatrixXd covariance;  ///< Of origin, direction (singular along itself) and scale.
  std::vector<std::string> parameter_names;
  Counts counts;  ///< Of readings; used: those at an edge.
  Verdict verdict;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
