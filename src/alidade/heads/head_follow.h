#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "alidade/heads/head_survey.h"
#include "alidade/heads/streams/frame_stream.h"
#include "alidade/pantilt/head.h"
#include "alidade/pantilt/positioner.h"
#include "alidade/servo/config.h"
#include "alidade/target/target_detector.h"

namespace alidade {

/// An axis of which nothing was identified: a model that is slower than the axis costs less than one that is faster.
inline constexpr PositionerParams usual_axis{
    .rate_rad_s = 0.7, .acceleration_rad_s2 = 2.0, .time_constant_s = 0.06, .latency_s = 0.05};

struct FollowedFrame;
struct HeadFollowing;

struct HeadFollowConfig {
  HeadRange range;
  double max_s = 60.0;                                           ///< For which the head is in use.
  std::array<PositionerParams, 2> axes{usual_axis, usual_axis};  ///< Pan and tilt, as --identify estimates them.
  double resolution_rad = 3e-4;                                  ///< The step of what is read.
  double delay_s = 0.0;  ///< A frame shows the angles of so much later than its time: as --calibrate estimates it.
  /// Called with each frame that was looked at.
  std::function<void(const FollowedFrame&, const cv::Mat&)> on_frame = {};
  /// Called with what is known so far every few seconds, or every twentieth of the time. Must not wait.
  std::function<void(const HeadFollowing&)> on_so_far = {};
};

/// A frame and what was seen in it.
struct FollowedFrame {
  double t_s = 0.0;              ///< Since the first.
  Eigen::Vector2d pan_tilt_rad;  ///< Of the head, when it was taken.
  bool is_found = false;
  Eigen::Vector2d px, target_rad;            ///< Where the target is in it; pan and tilt that would look at it.
  Eigen::Vector2d error_px;                  ///< From the principal point.
  std::optional<Eigen::Vector2d> asked_rad;  ///< Where the head was asked to point then.
};

/// What `servo` predicts for the same head, delays and target: the best of its controllers in a simulated loop.
struct FollowForecast {
  ControllerKind controller = ControllerKind::feedforward;
  double rms_px = 0.0;
  double period_s = 0.0;         ///< Of the commands.
  double image_age_s = 0.0;      ///< Of the newest image when a command is sent.
  double command_delay_s = 0.0;  ///< From a command to its first effect.
};

struct HeadFollowing {
  std::string url, stream;
  std::vector<FollowedFrame> frames;
  std::size_t num_commands = 0;
  std::size_t num_skipped = 0;  ///< Frames that were not looked at: newer ones had come.
  double head_time_s = 0.0;
  double rms_px = 0.0, max_px = 0.0, central_third = 0.0;  ///< From the first third of the time on.
  double period_s = 0.0, image_age_s = 0.0;                ///< Between commands; of the newest image at a command.
  std::optional<FollowForecast> forecast;                  ///< None: the target was not seen long enough.
  bool is_interrupted = false;                             ///< The rest is of before; the head was stopped.
  std::string fault;                                       ///< What broke on the way; likewise.
  Verdict verdict;
};

/// Looks for the target in frame after frame, predicts where it will be when a command acts, and sends the head there.
/// A target that was not seen for a second is not followed; the head stands until it is seen again. Throws InputError,
/// Interrupted where that was before the first frame; the head stands then.
[[nodiscard]] HeadFollowing follow_target(HeadDevice& device, FrameStream& stream, const RigHead& rig_head,
                                          const TargetLook& look, const cv::Mat* pattern,
                                          const HeadFollowConfig& config, const Progress& progress = {});

}  // namespace alidade
