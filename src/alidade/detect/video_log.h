#pragma once

#include <cstddef>
#include <filesystem>

#include "alidade/estimation/progress.h"
#include "alidade/images/video.h"
#include "alidade/pantilt/rotation_log.h"
#include "alidade/patches/point_tracks.h"

namespace alidade {

/// Reads the rotation of a camera while it filmed: a rotation log without points. Throws InputError.
[[nodiscard]] RotationLog read_angles(const std::filesystem::path& csv);

struct VideoLogConfig {
  /// Frame rate [Hz]: frame k was taken at t = k / rate, and the angles are interpolated to that time. 0: the angles
  /// have one row per frame, with its time.
  double rate_hz = 0.0;
  PointTrackerConfig tracker = {};
  std::size_t min_rows = 10;      ///< Points that were observed in fewer frames are rejected.
  std::size_t max_points = 1000;  ///< The points observed longest are kept.
};

/// The measurements made from a video and its angles.
struct VideoLog {
  RotationLog log;
  int width_px = 0, height_px = 0;
  std::size_t num_frames = 0;
  std::size_t num_tracks = 0;    ///< Tracked points, before short tracks were rejected.
  double median_sigma_px = 0.0;  ///< σ of one coordinate, as the tracker states it.
};

/// Tracks points through the video. One row per frame; for source `rate` the samples between frames are inserted as
/// rows without pixels, because the rotation is their integral. Throws InputError for a frame that cannot be read or
/// has another size, a frame whose time the angles do not cover, more or fewer rows than frames if no rate is given, or
/// nothing to track. `angles_name` begins the messages about the angles.
[[nodiscard]] VideoLog log_from_video(VideoFrames& video, const RotationLog& angles, const std::string& angles_name,
                                      const VideoLogConfig& config = {}, const Progress& progress = {});

}  // namespace alidade
