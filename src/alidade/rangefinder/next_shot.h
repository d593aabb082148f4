#pragma once

#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/public.h"
#include "alidade/rangefinder/report.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// A shot that the current estimate already includes, whose board pose was found.
struct TakenShot {
  double range_m = 0.0;
  Rigid3 cam_from_board;
  bool has_spot = false;
};

/// What is known of the beam, and how the next shots will be measured.
struct BeamNow {
  Beam beam;      ///< With its covariance, and its covariance with the lens.
  Camera camera;  ///< With its covariance where known.
  std::vector<Eigen::Vector3d> points_in_board;
  RangefinderMethod method = RangefinderMethod::joint;
  Refine refine = Refine::all;
  /// Whether the next shots will have a spot and a board: set as in the shots taken so far.
  bool sees_spots = true, sees_boards = true;
  double sigma_spot_px = 0.3;
  double sigma_corner_px = 0.2;
  bool estimate_scale = false;
  std::vector<TakenShot> taken = {};  ///< They add information about distortion that was fixed. May be empty.
  CountedSheet sheet = {};            ///< The sheet included in `beam.cov`, and its uncertainty after the shots.
};

struct ShotLimits {
  double min_range_m = 0.5, max_range_m = 4.0;
  double max_tilt_rad = 0.78;
};

/// A board pose to measure next, and the expected uncertainty.
struct NextShot {
  double distance_m = 0.0;   ///< Along the beam, as the rangefinder reads it.
  double tilt_rad = 0.0;     ///< Between the board's normal and the optical axis.
  double azimuth_rad = 0.0;  ///< Which side is farther: 0 right, ½π lower.
  Rigid3 cam_from_board;
  double sigma_origin_m = 0.0, sigma_direction_rad = 0.0;  ///< Including this shot and those before it.
  double spot_sigma_px = 0.0;                              ///< Largest at the four bound_ranges_m.
};

/// The shots that lower the uncertainty most, chosen greedily: each is the best over distances, tilts and azimuths by
/// the mean variance of the points that the beam will measure between its origin and the farthest range. Fewer than
/// `num_shots` where every other candidate would be averaged with one of these by rangefinder().
[[nodiscard]] std::vector<NextShot> plan_next_shots(const BeamNow& now, const ShotLimits& limits, int num_shots,
                                                    const Progress& progress = {});

/// Expected uncertainty after one more shot at this distance and tilt, best azimuth: √ of the mean variance [m].
struct ShotGain {
  double distance_m = 0.0, tilt_rad = 0.0;
  double sigma_point_m = 0.0;
};
[[nodiscard]] std::vector<ShotGain> next_shot_gains(const BeamNow& now, const ShotLimits& limits);

ALIDADE_PUBLIC_END
}  // namespace alidade
