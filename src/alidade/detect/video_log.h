#pragma once

#include <cstddef>
#include <filesystem>

#include "alidade/estimation/progress.h"
#include "alidade/images/video.h"
#include "alidade/pantilt/rotation_log.h"
#include "alidade/patches/point_tracks.h"

namespace alidade {

/// How a camera rotated while it filmed: a rotation log without points. Throws InputError.
[[nodiscard]] RotationLog read_angles(const std::filesystem::path& csv);

struct VideoLogConfig {
  /// Frames a second: frame k was taken at t = k / rate, and the angles are interpolated there. 0: the angles have one
  /// row a frame, with its time.
  double rate_hz = 0.0;
  PointTrackerConfig tracker = {};
  std::size_t min_rows = 10;      ///< Points that were seen in fewer frames are rejected.
  std::size_t max_points = 1000;  ///< The longest seen are kept.
};

/// The measurements of a video and its angles.
struct VideoLog {
  RotationLog log;
  int width_px = 0, height_px = 0;
  std::size_t num_frames = 0;
  std::size_t num_tracks = 0;    ///< Points that were followed, before the short ones were rejected.
  double median_sigma_px = 0.0;  ///< Of one coordinate, as the tracker states it.
};

/// Follows points through the video. One row a frame; for source `rate` the samples between the frames stand between
/// them as rows without pixels, because the rotation is their integral. Throws InputError: a frame that cannot be read
/// or has another size, a frame whose time the angles do not cover, more or fewer rows than frames where no rate is
/// given, nothing to follow. `angles_name` begins the messages about the angles.
[[nodiscard]] VideoLog log_from_video(VideoFrames& video, const RotationLog& angles, const std::string& angles_name,
                                      const VideoLogConfig& config = {}, const Progress& progress = {});

}  // namespace alidade
