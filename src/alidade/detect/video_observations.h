#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/images/video.h"
#include "alidade/pantilt/head.h"
#include "alidade/pantilt/rotation_log.h"
#include "alidade/target/target_detector.h"
#include "alidade/track/observation_model.h"

namespace alidade {

/// Encoder readings of heads over time.
struct HeadAngles {
  std::string name;               ///< Name of the file, with which messages begin.
  std::vector<RotationLog> logs;  ///< One per head of the rig, source `head`, without points.
};

/// Reads `t_s,head,pan_rad,tilt_rad` (also `t_capture_s`; `head` may be omitted if the rig has one head), in order of
/// time for each head. Throws InputError for a missing column, a head that is not in the rig or has no rows, times that
/// run backwards, or angles in `pan_deg`.
[[nodiscard]] HeadAngles read_head_angles(const std::filesystem::path& csv, std::span<const RigHead> heads);

[[nodiscard]] std::string head_angles_csv(const HeadAngles& angles, std::span<const RigHead> heads);

/// One frame, and what was detected in it.
struct TargetFrame {
  double t_s = 0.0;
  std::size_t head = 0;  ///< Index in the rig's list.
  std::size_t number = 0;
  Eigen::Vector2d pan_tilt_rad = Eigen::Vector2d::Zero();
  TargetDetection seen;
};

struct VideoObservationsConfig {
  /// Frame rate [Hz]: frame k was taken at t = k / rate, and the angles are interpolated to that time. 0: the angles
  /// have one row per frame, with its time.
  double rate_hz = 0.0;
  double max_speed_px_s = 2000.0;  ///< Largest speed of the target relative to static objects, in the initial search.
};

/// Detects the target in the videos of the heads, where the first video belongs to the first head and so on: first
/// where it is expected (the last observed direction, at the head's current angles), and if that fails in the whole
/// frame. Frames are in order of time. Throws InputError for a frame that cannot be read or is not of the camera's
/// size, a frame whose time the angles do not cover, or more or fewer rows than frames if no rate is given.
[[nodiscard]] std::vector<TargetFrame> target_frames(std::span<VideoFrames> videos, const HeadAngles& angles,
                                                     std::span<const RigHead> heads, const TargetLook& look,
                                                     const cv::Mat* pattern, const VideoObservationsConfig& config = {},
                                                     const Progress& progress = {});

/// The frames in which the target was detected, as observations that arrive when they are taken.
[[nodiscard]] std::vector<TargetObservation> observations_of(std::span<const TargetFrame> frames);

}  // namespace alidade
