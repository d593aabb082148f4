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

/// A straight piece of the head's way.
struct HeadLine {
  Eigen::Vector2d pan_tilt_rad, rate_rad_s;
};

/// How a head was seen to move: the smallest change of what it reads, its largest rate, and how often it was read.
struct HeadManner {
  double period_s = 0.0;  ///< Between readings: the median.
  Eigen::Vector2d step_rad = Eigen::Vector2d::Zero(), fastest_rad_s = Eigen::Vector2d::Zero();
};
[[nodiscard]] HeadManner manner_of(std::span<const HeadPosition> readings);

/// Pan and tilt at a time, where the head moves evenly (or stands) from a little before `from_s` to a little after
/// `until_s`: the line through what was read. None: it starts, stops or turns there, or how long its answers took
/// leaves that open: each reading is of some instant between question and answer. Where it stands answers may be slow;
/// where it moves all have to be as slow as each other, and what they have in common is in the delay.
[[nodiscard]] std::optional<HeadLine> even_motion(std::span<const HeadPosition> readings, const HeadManner& manner,
                                                  double t_s, double from_s, double until_s);

/// A rotation log of the frames that were taken in even motion; two rows without pixels before each give its rate.
/// `late_s`: frames are believed to show what was so much earlier.
[[nodiscard]] RotationLog turn_log(std::span<const HeadPosition> readings, std::span<const SeenFrame> frames,
                                   double late_s, double origin_s);

}  // namespace alidade
