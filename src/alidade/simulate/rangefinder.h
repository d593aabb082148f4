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

/// A world for `rangefinder`: a camera, a beam, and where a board was held so that the beam hits it.
struct RangefinderScene {
  Camera camera;
  Board board;
  Beam beam;                           ///< beam.noise: what the readings will have.
  std::vector<Rigid3> cam_from_board;  ///< One per shot.
  std::vector<double> range_m;         ///< True reading of each shot.
};

struct RangefinderSceneConfig {
  int num_shots = 18;
  double min_range_m = 0.5, max_range_m = 4.0;
  bool uniform_in_inverse_range = false;  ///< Else uniform in the range.
  double min_tilt_rad = 0.0, max_tilt_rad = 0.7853981633974483;
  std::optional<double> azimuth_rad = {};  ///< Of the tilt: all boards parallel with one tilt. None: any side.
  Beam beam;
  Board board{.cols = 9, .rows = 6, .square_m = 0.04};
  Camera camera;
};

struct ShotNoise {
  double sigma_corner_px = 0.2;
  double sigma_spot_px = 0.3;
  double sigma_spot_near_px = 0.0;  ///< Of a spot at 1 m beyond that; it falls with the range: a wide spot, speckle.
  double outlier_share = 0.0;       ///< Of the shots, rounded: their readings are 0.3 to 1 m too long.
  double bow_m = 0.0;               ///< Of the board along its rows: of its centre over its left and right border.
  double twist_m = 0.0;             ///< Of its corners out of its plane.
  double incidence_m = 0.0;         ///< That a reading at 45° is too long by; grows with the tangent of that angle.
  double sheet_m = 0.0;             ///< By which what the beam hits lies before the plane of the corners.
  bool with_spot = true, with_board = true;
};

/// The scenarios by name: reference, table1, parallel, frontal, equal_range, through_centre, toed_in, near_frontal,
/// short_span, inverse_range, four_shots. None for an unknown name. The camera is 1280×960, f 1200 px.
[[nodiscard]] std::optional<RangefinderSceneConfig> rangefinder_scenario(std::string_view name);
[[nodiscard]] std::vector<std::string> rangefinder_scenarios();

/// Draws boards that are all inside the image and hit by the beam. Same seed, same scene.
[[nodiscard]] RangefinderScene draw_rangefinder_scene(const RangefinderSceneConfig& config, std::uint64_t seed);

/// What is measured in such a world. Corners bring their covariance; spots and readings bring no σ.
struct SimulatedShots {
  std::vector<Shot> shots;
  std::vector<bool> is_outlier;
};
[[nodiscard]] SimulatedShots simulate_shots(const RangefinderScene& scene, const ShotNoise& noise, std::uint64_t seed);

/// What a user got wrong, or did not know, about such a log.
struct ShotMistake {
  double focal = 0.0;        ///< Share by which the camera file's focal length is too long.
  double centre_px = 0.0;    ///< By which its centre lies aside, in u and in v.
  double k1 = 0.0;           ///< By which its k1 is too large, for the file's σ of fx, fy, cx, cy alone.
  double p1 = 0.0;           ///< By which its p1 is too large, the same.
  double drift_m = 0.0;      ///< That the readings are too long by at the last shot, evenly from none at the first.
  double bend_m = 0.0;       ///< That a reading of 1 m or 3 m is too long by against one of 2 m: a parabola.
  double wander_px = 0.0;    ///< That the spots stand lower and to the right by at the last shot, as the drift.
  bool exchange_uv = false;  ///< u of the spots is in the column of v.
  double offset_m = 0.0;     ///< That each reading is too long.
  double unit_m = 1.0;       ///< Of the readings: 0.0254 where they are inches.
  int shift_rows = 0;        ///< The ranges stand so many rows later than their boards and spots.
};
[[nodiscard]] std::vector<Shot> mistaken_shots(std::vector<Shot> shots, const ShotMistake& mistake);
[[nodiscard]] Camera mistaken_camera(Camera camera, const ShotMistake& mistake);

}  // namespace alidade
