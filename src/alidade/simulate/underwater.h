#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/geometry/rigid3.h"

namespace alidade {

/// A world for `localize`: a camera under water that swings in front of a board. Its values are those of the experiment
/// of Xu & Xu, "Underwater monocular localization with lens distortion", as far as the paper states them.
struct UnderwaterScene {
  Camera camera;       ///< See underwater_camera().
  int num_points = 8;  ///< The board's 8, then others around and behind it.
  std::vector<long> known{2, 4, 6, 8};
  int num_frames = 35;
  double dt_s = 0.1;
  double sigma_px = 0.5;
  double sigma_known_m = 0.001;  ///< σ of each coordinate of a known point.
  double sigma_depth = 0.03;     ///< σ of the initial depth of an unknown point, over the depth.
  double sigma_position_m = 0.005, sigma_rotation_rad = 0.01;  ///< σ of the initial state given to a filter.
  double mismatches = 0.0;    ///< Share of the observations after the first frame that are of another point.
  double mismatch_px = 60.0;  ///< Largest distance, in each coordinate.
  double blackout_from_s = 0.0, blackout_s = 0.0;  ///< Start and duration of an interval without observations.
  // What differs from the filter's assumptions.
  double readout_s = 0.0;         ///< From an image's first row to its last; its time is that of the central row.
  double late_s = 0.0;            ///< Images are taken this long before their time stamps.
  int missing_every = 0;          ///< The last of so many frames is missing, and later times have no gap there.
  double target_speed_m_s = 0.0;  ///< Speed of the board along its x, relative to the other points.
  double target_stretch = 0.0;    ///< Relative excess of the known points' distances along x, as given.
};

/// 768×576, fx 768, fy 766, cx 389, cy 284, k1 −0.44881, k2 0.0664, p1 0.01316, p2 0.00218: strong distortion, which
/// folds at r = 0.989.
[[nodiscard]] Camera underwater_camera();

struct UnderwaterObservation {
  long id = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  bool is_mismatch = false;
};

struct UnderwaterFrame {
  double t_s = 0.0;       ///< The time stamp.
  Rigid3 world_from_cam;  ///< The true pose when it was taken.
  std::vector<UnderwaterObservation> observations;
};

/// What a filter is given of a point before its first observation, and the truth.
struct UnderwaterPoint {
  long id = 0;
  bool is_known = false;
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
  Eigen::Vector3d given_in_world = Eigen::Vector3d::Zero();  ///< Given position of a known point.
  double given_depth_m = 0.0;  ///< Depth along the optical axis at the first observation of an unknown point.
};

struct UnderwaterSequence {
  std::function<Rigid3(double t_s)> world_from_cam;  ///< The truth at any time.
  std::vector<UnderwaterFrame> frames;
  std::vector<UnderwaterPoint> points;
  Rigid3 given_start;  ///< The first pose as given to a filter.
};

/// Vertices of a 10×8 grid of 28 mm: 1 (0,0), 2 (9,0), 3 (9,7), 4 (0,7), 5 (5,4), 6 (2,2), 7 (7,2), 8 (7,5); the world
/// is the board's frame, z away from the camera. The path: 0.62 ± 0.10 m in front, ± 0.12 and 0.09 m aside, rotating by
/// ± 8° about each axis, in sines of 2.6 to 4.5 s. Same seed, same sequence.
[[nodiscard]] UnderwaterSequence simulate_underwater(const UnderwaterScene& scene, std::uint64_t seed);

/// Which of the points 1 to 8 a corner of that grid is; corners are counted row by row from 0.
[[nodiscard]] std::optional<long> underwater_point_at(int corner);

}  // namespace alidade
