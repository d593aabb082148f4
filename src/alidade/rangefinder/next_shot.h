#pragma once

#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/public.h"
#include "alidade/rangefinder/report.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// A shot behind what is known, whose board's pose was found.
struct TakenShot {
  double range_m = 0.0;
  Rigid3 cam_from_board;
  bool has_spot = false;
};

/// What is known of the beam, and what the next shots will be measured with.
struct BeamNow {
  Beam beam;      ///< With covariance, and covariance with the lens.
  Camera camera;  ///< With covariance where known.
  std::vector<Eigen::Vector3d> points_in_board;
  RangefinderMethod method = RangefinderMethod::joint;
  Refine refine = Refine::all;
  /// Whether the next shots will have a spot and a board: as those behind it have.
  bool sees_spots = true, sees_boards = true;
  double sigma_spot_px = 0.3;
  double sigma_corner_px = 0.2;
  bool estimate_scale = false;
  std::vector<TakenShot> taken = {};  ///< For what they say of distortion that was held. May be empty.
  CountedSheet sheet = {};            ///< Of what `beam.cov` has of it, and what shots leave open of it.
};

struct ShotLimits {
  double min_range_m = 0.5, max_range_m = 4.0;
  double max_tilt_rad = 0.78;
};

/// A pose for the board, and what would be known with it.
struct NextShot {
  double distance_m = 0.0;   ///< Along the beam, as read.
  double tilt_rad = 0.0;     ///< Between the board's normal and the camera's view.
  double azimuth_rad = 0.0;  ///< Which side is farther: 0 right, ½π the lower.
  Rigid3 cam_from_board;
  double sigma_origin_m = 0.0, sigma_direction_rad = 0.0;  ///< With it and the ones before.
  double spot_sigma_px = 0.0;                              ///< Worst over the four ranges of the bound.
};

/// The shots that lower the uncertainty most, one after the other: each the best over distances, tilts and sides by the
/// mean variance of the points that the beam will measure from its origin to the farthest range. Fewer where no other
/// is left that rangefinder() would not average with one of these.
[[nodiscard]] std::vector<NextShot> plan_next_shots(const BeamNow& now, const ShotLimits& limits, int num_shots,
                                                    const Progress& progress = {});

/// What each distance × tilt would bring as the next shot, best side each: √ of the mean variance after it. [m]
struct ShotGain {
  double distance_m = 0.0, tilt_rad = 0.0;
  double sigma_point_m = 0.0;
};
[[nodiscard]] std::vector<ShotGain> next_shot_gains(const BeamNow& now, const ShotLimits& limits);

ALIDADE_PUBLIC_END
}  // namespace alidade
