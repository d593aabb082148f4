#pragma once

#include <string>
#include <vector>

#include "alidade/heads/head_survey.h"
#include "alidade/heads/streams/frame_stream.h"
#include "alidade/pantilt/head.h"
#include "alidade/target/target_detector.h"

namespace alidade {

struct HeadFollowConfig {
  HeadRange range;
  double most_s = 60.0;     ///< For which the head is held.
  double latency_s = 0.05;  ///< From a command to its first effect: as --identify estimates it.
  double delay_s = 0.0;     ///< A frame shows the angles of so much later than its time: as --calibrate estimates it.
};

/// A frame and what was seen in it.
struct FollowedFrame {
  double t_s = 0.0;              ///< Since the first.
  Eigen::Vector2d pan_tilt_rad;  ///< Of the head, when it was taken.
  bool is_found = false;
  Eigen::Vector2d px, target_rad;  ///< Where the target is in it; pan and tilt that would look at it.
  double error_px = 0.0;           ///< From the principal point.
};

struct HeadFollowing {
  std::string url, stream;
  std::vector<FollowedFrame> frames;
  std::size_t num_commands = 0;
  double head_time_s = 0.0;
  double rms_px = 0.0, max_px = 0.0, central_third = 0.0;  ///< From the first third of the time on.
  Verdict verdict;
};

/// Looks for the target in frame after frame, predicts where it will be when a command acts, and sends the head there.
/// A target that was not seen for a second is not followed; the head stands until it is seen again. Throws InputError,
/// Interrupted: the head stands then.
[[nodiscard]] HeadFollowing follow_target(HeadDevice& device, FrameStream& stream, const RigHead& rig_head,
                                          const TargetLook& look, const cv::Mat* pattern,
                                          const HeadFollowConfig& config, const Progress& progress = {});

}  // namespace alidade
