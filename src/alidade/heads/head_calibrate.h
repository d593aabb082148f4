#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "alidade/board/board.h"
#include "alidade/heads/head_survey.h"
#include "alidade/heads/streams/frame_stream.h"
#include "alidade/observe/report.h"

namespace alidade {

struct HeadCalibration;

struct HeadCalibrationConfig {
  HeadRange range;
  /// Until 3σ of fx and fy are this share of them; none: for as long as its usual moves take.
  std::optional<double> until;
  double max_s = 85.0;  ///< For which the head is in use.
  /// Followed instead of points: its corners, wherever all of it is seen. None: points of the world.
  std::optional<Board> board = {};
  /// What an earlier run of the same head and camera measured: counts as well.
  std::optional<RotationLog> before = {};
  /// What is known so far, every few seconds: its log, and the estimate where there is one.
  std::function<void(const HeadCalibration&)> on_so_far = {};
};

/// What a head and its camera show while the head moves.
struct HeadCalibration {
  std::string url, stream;
  int width_px = 0, height_px = 0;
  std::size_t num_frames = 0, num_moves = 0;
  std::size_t num_skipped = 0;  ///< Of the frames: points in them would have been followed behind time.
  FrameTimes times = FrameTimes::arrival;
  double sigma_frame_s = 0.0;  ///< Of a frame's time, but for what all are late alike.
  std::size_t num_jumps = 0;   ///< Of time stamps, which therefore were not used; 0: they were, or there are none.
  double largest_jump_s = 0.0;
  double head_time_s = 0.0;
  double sigma_clock_s =
      0.0;  ///< Of the head's times against the frames'; in σ of the delay beside what the log determines.
  double answer_s = 0.0;         ///< What the head's answers take: the median.
  bool has_seen_points = false;  ///< In some frame, whether or not the head's angle is known for it.
  double sigma_angle_rad = 0.0;  ///< Noise of the readings (rounding, too) that is estimated with the rest; 0: none.
  bool is_of_shots = false;      ///< Single images while the head stood; else of a video.
  double narrow_focal_px = 0.0;  ///< Above zero: the field is so narrow that only one focal length is determined.
  std::string fault;             ///< What broke on the way; the head was stopped, and the rest is of before.
  std::string log_csv;           ///< What `offline` reads, as log.csv.
  std::vector<std::string> offline;  ///< `alidade` with these words, in the folder of log.csv, gives the same numbers.
  ObserveReport report;
  Verdict verdict;
};

/// The words of `HeadCalibration::offline`.
[[nodiscard]] std::vector<std::string> offline_words(const HeadCalibration& result);
/// Two logs of one head and camera, one after the other; points of one are not those of the other.
[[nodiscard]] RotationLog joined_logs(const RotationLog& before, const RotationLog& now);

/// Moves the head, follows points in what its camera sees, and estimates until the goal or the time is reached; moves
/// are planned by what is known so far. Throws InputError, Interrupted: the head stands then.
[[nodiscard]] HeadCalibration calibrate_head(HeadDevice& device, FrameStream& stream,
                                             const HeadCalibrationConfig& config, const Progress& progress = {});

}  // namespace alidade
