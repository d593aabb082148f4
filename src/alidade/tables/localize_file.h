#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/localize/localize.h"

namespace alidade {

struct ObservationsFile {
  std::vector<ObservationFrame>
      frames;  ///< In order of time; also those in which nothing is seen, where numbers are missing.
  std::vector<SkippedInput> skipped;
};

struct ObservationsOptions {
  bool skip_bad = false;  ///< Leave out rows that are wrong, by name.
  double rate_hz = 0.0;   ///< Above 0: the time of a frame is its number over this.
  int width_px = 0,
      height_px = 0;  ///< Of the camera: an observation further outside than half the image is in no image.
};

/// Reads `frame,t_s,point_id,u_px,v_px`, a row an observation. An empty `point_id` is a frame in which nothing was
/// seen. Numbers that are missing between frames become frames without observations. Throws InputError: a missing
/// column, times or frames that run backwards, a frame with two times, a point that stands twice in a frame, no rows.
[[nodiscard]] ObservationsFile read_observations(const std::filesystem::path& file, const ObservationsOptions& options);
[[nodiscard]] std::string observations_csv(std::span<const ObservationFrame> frames);

/// A target, and what is said of its size and its side.
struct TargetFile {
  std::vector<KnownPoint> points;
  bool is_board = false;
  bool is_scale_told = false;  ///< Each point has its σ, or the board's square has.
  double sigma_scale = 0.0;    ///< Of a board's square, relative.
  bool seen_from_plus_z = false;
};

/// Reads target.yaml: `points: [{id, x_m, y_m, z_m, sigma_m}]` or `board: {corners: 9x6, square_m, sigma_square_m}`
/// (ids from 0). `seen_from: +z` says that the side of points in the plane of x and y which is seen is that of +z;
/// without it is −z, as with a board's.
[[nodiscard]] TargetFile read_target_file(const std::filesystem::path& file);
/// Its points alone.
[[nodiscard]] std::vector<KnownPoint> read_target(const std::filesystem::path& file);
[[nodiscard]] std::string target_text(std::span<const KnownPoint> points);

/// What a run is told before the first frame.
struct StartFile {
  StartHypothesis start;
  double depth_m = 0.0, sigma_depth = 0.5;  ///< Of new points; 0: not told.
  std::vector<ToldDepth> depths;
};

/// Reads start.yaml: position_m, quaternion_wxyz (world_from_cam), velocity_m_s, rate_rad_s, sigma_position_m,
/// sigma_rotation_rad, sigma_velocity_m_s, sigma_rate_rad_s, depth_m, sigma_depth, depths: [{id, depth_m, sigma_rel}].
[[nodiscard]] StartFile read_start(const std::filesystem::path& file);
[[nodiscard]] std::string start_text(const StartFile& start);

/// Poses as TUM writes them, `t x y z qx qy qz qw`, in order of time; lines that begin with # are comments.
[[nodiscard]] std::vector<TimedPose> read_tum(const std::filesystem::path& file);
[[nodiscard]] std::string tum_text(std::span<const TimedPose> poses);

/// Text of map.csv: `point_id,x_m,y_m,z_m,sigma_m` (σ: root of the mean variance), then the covariance.
[[nodiscard]] std::string map_csv(std::span<const MapPoint> points);
/// Text of map.ply, with `sigma_m` of each vertex.
[[nodiscard]] std::string map_ply(std::span<const MapPoint> points);
/// Text of poses.csv: a row a frame, with the upper triangle of the 6×6 covariance of world_from_cam.
[[nodiscard]] std::string poses_csv(std::span<const PathStep> path);

}  // namespace alidade
