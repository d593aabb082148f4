#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/heads/head_device.h"
#include "alidade/pantilt/rotation_log.h"
#include "alidade/patches/point_tracks.h"

namespace alidade {

/// The points of a frame.
struct SeenFrame {
  double t_s = 0.0;
  std::vector<TrackedPoint> points;
};

/// A straight part of the head's path.
struct HeadLine {
  Eigen::Vector2d pan_tilt_rad, rate_rad_s;
};

/// Observed motion of a head: the smallest change of its readings, its largest rate, and the interval of readings.
struct HeadManner {
  double period_s = 0.0;  ///< Median interval between readings.
  Eigen::Vector2d step_rad = Eigen::Vector2d::Zero(), fastest_rad_s = Eigen::Vector2d::Zero();
};
[[nodiscard]] HeadManner manner_of(std::span<const HeadPosition> readings);

/// Pan and tilt at a time, if the head moves uniformly (or is at rest) from a little before `from_s` to a little after
/// `until_s`: the line through the readings. None: it starts, stops or reverses there, or its response times leave that
/// open: each reading is from some instant between request and reply. At rest, replies may be slow; in motion,
/// all must be equally slow, and their common delay is part of the delay.
[[nodiscard]] std::optional<HeadLine> even_motion(std::span<const HeadPosition> readings, const HeadManner& manner,
                                                  double t_s, double from_s, double until_s);

/// A rotation log of the frames taken in uniform motion; two rows without pixels before each give its rate.
/// `late_s`: frames are assumed to show the scene this much earlier.
[[nodiscard]] RotationLog turn_log(std::span<const HeadPosition> readings, std::span<const SeenFrame> frames,
                                   double late_s, double origin_s);

}  // namespace alidade
