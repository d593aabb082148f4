#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "alidade/localize/config.h"
#include "alidade/localize/localization.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

struct ObservationsOptions {
  bool skip_bad = false;  ///< Rows that are wrong are skipped and listed.
  double rate_hz = 0.0;   ///< If positive, a frame's time is its number over this rate.
  int width_px = 0,
      height_px = 0;  ///< The camera's size. Rejected: observations farther outside than half the image.
};

/// Reads `frame,t_s,point_id,u_px,v_px`, one observation per row. An empty `point_id` marks a frame without
/// observations. Missing frame numbers become frames without observations. Throws InputError for a missing column,
/// times or frames that run backwards, a frame with two times, a duplicate point in a frame, or no rows.
[[nodiscard]] ObservationTable read_observations(const std::filesystem::path& file, const ObservationsOptions& options);
[[nodiscard]] std::string observations_csv(std::span<const ObservationFrame> frames);

/// Reads target.yaml: `points: [{id, x_m, y_m, z_m, sigma_m}]` or `board: {corners: 9x6, square_m, sigma_square_m}`
/// (ids from 0). `seen_from: +z` states that points in the x-y plane are seen from the +z side; the default is −z, as
/// for a board.
[[nodiscard]] LocalizeTarget read_target(const std::filesystem::path& file);
[[nodiscard]] std::string target_text(std::span<const KnownPoint> points);

/// Reads start.yaml: position_m, quaternion_wxyz (world_from_cam), velocity_m_s, rate_rad_s, sigma_position_m,
/// sigma_rotation_rad, sigma_velocity_m_s, sigma_rate_rad_s, depth_m, sigma_depth, depths: [{id, depth_m, sigma_rel}].
[[nodiscard]] LocalizeStart read_start(const std::filesystem::path& file);
[[nodiscard]] std::string start_text(const LocalizeStart& start);

/// Reads `t_s,depth_m[,sigma_m]` of a pressure sensor, in order of time: its depth, up to an offset. The default σ is
/// 0.01 m. Throws InputError; with `skip_bad`, wrong rows are added to `skipped` instead.
[[nodiscard]] std::vector<DepthReading> read_depth_sensor(const std::filesystem::path& file, bool skip_bad = false,
                                                          std::vector<SkippedInput>* skipped = nullptr);
/// Reads `t_s,range_m` of a rangefinder, in order of time. Throws InputError.
[[nodiscard]] std::vector<RangeReading> read_ranges(const std::filesystem::path& file, bool skip_bad = false,
                                                    std::vector<SkippedInput>* skipped = nullptr);

/// Reads `t_s,x_m,y_m[,z_m]` of odometry, in order of time. Throws InputError.
[[nodiscard]] std::vector<OdometryReading> read_odometry(const std::filesystem::path& file, bool skip_bad = false,
                                                         std::vector<SkippedInput>* skipped = nullptr);

/// Reads `t_s,omega_x_rad_s,…,force_x_m_s2,…` of an IMU, or EuRoC's imu0/data.csv (`#timestamp [ns],w_RS_S_x [rad
/// s^-1],…,a_RS_S_x [m s^-2],…`), in order of time. For EuRoC, t_s is relative to `origin_ns`. Throws InputError.
[[nodiscard]] std::vector<ImuReading> read_imu(const std::filesystem::path& file, bool skip_bad = false,
                                               std::vector<SkippedInput>* skipped = nullptr,
                                               std::int64_t origin_ns = 0);
[[nodiscard]] std::string imu_csv(std::span<const ImuReading> readings);
/// Reads cam_from_imu: translation_m, quaternion_wxyz, or Kalibr's T_cam_imu; sigma_rotation_rad, sigma_translation_m.
[[nodiscard]] ImuMounting read_imu_mounting(const std::filesystem::path& file);
[[nodiscard]] std::string imu_mounting_text(const ImuMounting& mounting);

/// Reads poses in TUM's format, `t x y z qx qy qz qw`, in order of time; lines that begin with # are comments.
[[nodiscard]] std::vector<TimedPose> read_tum(const std::filesystem::path& file);
[[nodiscard]] std::string tum_text(std::span<const TimedPose> poses);

/// Text of map.csv: `point_id,x_m,y_m,z_m,sigma_m` (root of the mean variance), followed by the covariance.
[[nodiscard]] std::string map_csv(std::span<const MapPoint> points);
/// Text of map.ply, with `sigma_m` of each vertex.
[[nodiscard]] std::string map_ply(std::span<const MapPoint> points);
/// Text of poses.csv: one row per frame, with the upper triangle of the 6×6 covariance of world_from_cam.
[[nodiscard]] std::string poses_csv(std::span<const PathStep> path);

ALIDADE_PUBLIC_END
}  // namespace alidade
