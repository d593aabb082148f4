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

/// Axis that was not identified: a model slower than the axis costs less than a faster one.
inline constexpr PositionerParams usual_axis{
    .rate_rad_s = 0.7, .acceleration_rad_s2 = 2.0, .time_constant_s = 0.06, .latency_s = 0.05};

struct FollowedFrame;
struct HeadFollowing;

struct HeadFollowConfig {
  HeadRange range;
  double max_s = 60.0;                                           ///< Maximum duration of use of the head.
  std::array<PositionerParams, 2> axes{usual_axis, usual_axis};  ///< Pan and tilt, as estimated by --identify.
  double resolution_rad = 3e-4;                                  ///< Resolution of the readings.
  double delay_s = 0.0;  ///< A frame shows the angles at this time after its time stamp: as estimated by --calibrate.
  /// Called with each processed frame.
  std::function<void(const FollowedFrame&, const cv::Mat&)> on_frame = {};
  /// Called with the results so far every few seconds, or every twentieth of the time. Must not block.
  std::function<void(const HeadFollowing&)> on_so_far = {};
};

/// A frame and its observation.
struct FollowedFrame {
  double t_s = 0.0;              ///< Since the first frame.
  Eigen::Vector2d pan_tilt_rad;  ///< Of the head at exposure.
  bool is_found = false;
  Eigen::Vector2d px, target_rad;            ///< Pixel of the target; pan and tilt that would point at it.
  Eigen::Vector2d error_px;                  ///< From the principal point.
  std::optional<Eigen::Vector2d> asked_rad;  ///< Position requested of the head at that time.
};

/// Prediction of `servo` for the same head, delays and target: the best of its controllers in a simulated loop.
struct FollowForecast {
  ControllerKind controller = ControllerKind::feedforward;
  double rms_px = 0.0;
  double period_s = 0.0;         ///< Of the commands.
  double image_age_s = 0.0;      ///< Of the newest image when a command is sent.
  double command_delay_s = 0.0;  ///< From a command to the start of its effect.
};

struct HeadFollowing {
  std::string url, stream;
  std::vector<FollowedFrame> frames;
  std::size_t num_commands = 0;
  std::size_t num_skipped = 0;  ///< Frames not processed because newer ones had arrived.
  double head_time_s = 0.0;
  double rms_px = 0.0, max_px = 0.0, central_third = 0.0;  ///< After the first third of the time.
  double period_s = 0.0, image_age_s = 0.0;                ///< Between commands; of the newest image at a command.
  std::optional<FollowForecast> forecast;                  ///< None: the target was not visible long enough.
  bool is_interrupted = false;                             ///< The results are from before; the head was stopped.
  std::string fault;                                       ///< Failure during the run; likewise.
  Verdict verdict;
};

/// Detects the target frame by frame, predicts its position when a command takes effect, and sends the head there.
/// A target not seen for a second is not tracked; the head stops until it is seen again. Throws InputError,
/// Interrupted if that happens before the first frame, with the head stopped.
[[nodiscard]] HeadFollowing follow_target(HeadDevice& device, FrameStream& stream, const RigHead& rig_head,
                                          const TargetLook& look, const cv::Mat* pattern,
                                          const HeadFollowConfig& config, const Progress& progress = {});

}  // namespace alidade
