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

/// One reading of a rangefinder on the same head as the camera; angles as in pantilt/head_rotation.h.
struct ScanRow {
  double pan_rad = 0.0, tilt_rad = 0.0;
  double range_m = 0.0;
};

struct EdgesConfig {
  double jump_m = 0.15;  ///< Difference of range between neighbouring readings that counts as an edge.
  std::vector<double> blur_px = {25.0, 10.0, 5.0};   ///< Blur of the image's edges, coarse to fine.
  double photo_pan_rad = 0.0, photo_tilt_rad = 0.0;  ///< Angles of the head when the photo was taken.
  int max_evaluations = 600;                         ///< Of the cost function, for each blur.
  Beam initial_guess = {};                           ///< Default: along the optical axis, unless more is known.
};

/// What is wrong with the config, one sentence each; empty where it is usable.
[[nodiscard]] std::vector<std::string> faults(const EdgesConfig& config);

struct EdgesReport {
  /// The direction is useful; the origin is known to centimetres only. The covariance includes the scatter between
  /// parts of the scene, and the prior that keeps the origin near the initial guess, whose error the direction absorbs.
  Beam beam;
  int num_edges = 0;  ///< Range edges in the scan.
  double gain = 0.0;  ///< Mean log of the image's edge density at the scan's edges, relative to a uniform density.
  double halves_differ_rad = 0.0;  ///< Angle between the directions estimated from each half of the edges.
};

/// The result of rangefinder_by_edges(); its verdict is never better than `care`.
struct EdgesCalibration : EdgesReport {
  Camera camera;               ///< As given.
  Eigen::MatrixXd covariance;  ///< Origin, direction (singular along itself), scale.
  std::vector<std::string> parameter_names;
  Counts counts;  ///< Number of readings; used: those at an edge.
  Verdict verdict;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
