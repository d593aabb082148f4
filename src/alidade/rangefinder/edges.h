#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "alidade/beam/beam.h"
#include "alidade/estimation/progress.h"
#include "alidade/estimation/verdict.h"

namespace alidade {

/// One reading of a rangefinder that turns with the camera on a head; angles as in pantilt/head_rotation.h.
struct ScanRow {
  double pan_rad = 0.0, tilt_rad = 0.0;
  double range_m = 0.0;
};

/// Grey values, row-major.
struct GreyImage {
  int width_px = 0, height_px = 0;
  std::vector<float> values;
};

struct EdgesConfig {
  double jump_m = 0.15;                              ///< Between neighbours of the scan: an edge of something.
  std::vector<double> blur_px = {25.0, 10.0, 5.0};   ///< Of the image's edges, coarse to fine.
  double photo_pan_rad = 0.0, photo_tilt_rad = 0.0;  ///< Where the head stood when the photo was taken.
  int max_evaluations = 600;                         ///< For each blur.
};

struct EdgesReport {
  /// Of use is the direction; the origin is told by centimetres. Its covariance counts how parts of the scene differ,
  /// and that the origin was held near the start: where it is elsewhere, the direction makes up for it.
  Beam beam;
  int num_edges = 0;               ///< In the scan.
  double gain = 0.0;               ///< Mean log of the image's edge density at the scan's edges over a uniform one.
  double halves_differ_rad = 0.0;  ///< Direction from one half of the edges against the other's.
};

/// The beam whose scan edges lie on the photo's edges: minimises the Kullback–Leibler divergence of their density from
/// the image's, const − mean log Q(pixel of an edge), over five parameters by a simplex. Needs no target, but a head,
/// thousands of readings and a scene with depth; a check of the direction to some mrad, not a calibration.
/// The existing algorithm of Wang & Li 2020, Table 2; simplex: J. A. Nelder & R. Mead, 1965.
[[nodiscard]] EdgesReport align_edges(std::span<const ScanRow> scan, const GreyImage& photo, const Camera& camera,
                                      const Beam& start, const EdgesConfig& config = {}, const Progress& progress = {});

/// What such an answer is worth: never better than care.
[[nodiscard]] Verdict edges_verdict(const EdgesReport& report);

}  // namespace alidade
