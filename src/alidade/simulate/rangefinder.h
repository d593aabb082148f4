#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/beam/beam.h"
#include "alidade/beam/shot.h"
#include "alidade/board/board.h"
#include "alidade/camera/camera.h"

namespace alidade {

/// A world for `rangefinder`: a camera, a beam, and poses of a board in which the beam hits it.
struct RangefinderScene {
  Camera camera;
  Board board;
  Beam beam;                           ///< beam.noise: the noise of the readings.
  std::vector<Rigid3> cam_from_board;  ///< One per shot.
  std::vector<double> range_m;         ///< True reading of each shot.
};

struct RangefinderSceneConfig {
  int num_shots = 18;
  double min_range_m = 0.5, max_range_m = 4.0;
  bool uniform_in_inverse_range = false;  ///< False: uniform in the range.
  double min_tilt_rad = 0.0, max_tilt_rad = 0.7853981633974483;
  std::optional<double> azimuth_rad = {};  ///< Direction of the tilt: with one tilt all boards are parallel. None: any.
  Beam beam;
  Board board{.cols = 9, .rows = 6, .square_m = 0.04};
  Camera camera;
};

struct ShotNoise {
  double sigma_corner_px = 0.2;
  double sigma_spot_px = 0.3;
  double sigma_spot_near_px = 0.0;  ///< Further σ of a spot at 1 m, falling with the range: a wide spot, speckle.
  double outlier_share = 0.0;       ///< Share of the shots, rounded, whose readings are 0.3 to 1 m too long.
  double bow_m = 0.0;               ///< Bow of the board along its rows: of its centre over its left and right border.
  double twist_m = 0.0;             ///< Distance of its corners from its plane.
  double incidence_m = 0.0;         ///< Excess of a reading at 45°; it grows with the tangent of that angle.
  double sheet_m = 0.0;             ///< Distance of the surface hit by the beam in front of the plane of the corners.
  bool with_spot = true, with_board = true;
};

/// The scenarios by name: reference, table1, parallel, frontal, equal_range, through_centre, toed_in, near_frontal,
/// short_span, inverse_range, four_shots. None for an unknown name. The camera is 1280×960, f 1200 px.
[[nodiscard]] std::optional<RangefinderSceneConfig> rangefinder_scenario(std::string_view name);
[[nodiscard]] std::vector<std::string> rangefinder_scenarios();

/// Draws boards that are wholly inside the image and hit by the beam. Same seed, same scene.
[[nodiscard]] RangefinderScene draw_rangefinder_scene(const RangefinderSceneConfig& config, std::uint64_t seed);

/// Measurements in such a world. Corners have their covariance; spots and readings have no σ.
struct SimulatedShots {
  std::vector<Shot> shots;
  std::vector<bool> is_outlier;
};
[[nodiscard]] SimulatedShots simulate_shots(const RangefinderScene& scene, const ShotNoise& noise, std::uint64_t seed);

/// Mistakes of a user, or unknown errors, in such a log.
struct ShotMistake {
  double focal = 0.0;        ///< Relative excess of the camera file's focal length.
  double centre_px = 0.0;    ///< Error of its centre, in u and in v.
  double k1 = 0.0;           ///< Excess of its k1, while the file's σ is that of fx, fy, cx, cy alone.
  double p1 = 0.0;           ///< Excess of its p1, likewise.
  double drift_m = 0.0;      ///< Excess of the last shot's reading; it grows evenly from zero at the first.
  double bend_m = 0.0;       ///< Excess of a reading of 1 m or 3 m over one of 2 m: a parabola.
  double wander_px = 0.0;    ///< Shift of the last shot's spot down and to the right; it grows as the drift.
  bool exchange_uv = false;  ///< u of the spots is in the column of v, and vice versa.
  double offset_m = 0.0;     ///< Excess of every reading.
  double unit_m = 1.0;       ///< Unit of the readings: 0.0254 for inches.
  int shift_rows = 0;        ///< The ranges are this many rows later than their boards and spots.
};
[[nodiscard]] std::vector<Shot> mistaken_shots(std::vector<Shot> shots, const ShotMistake& mistake);
[[nodiscard]] Camera mistaken_camera(Camera camera, const ShotMistake& mistake);

}  // namespace alidade
