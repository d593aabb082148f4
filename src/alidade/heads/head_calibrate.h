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
  /// Until 3σ of fx and fy are this fraction of them; none: until the usual moves are done.
  std::optional<double> until;
  double max_s = 85.0;  ///< Maximum duration of use of the head.
  /// A board to track instead of scene points: its corners, whenever it is completely visible. None: scene points.
  std::optional<Board> board = {};
  /// Measurements of an earlier run with the same head and camera: included.
  std::optional<RotationLog> before = {};
  /// The results so far, every few seconds: the log, and the estimate if there is one.
  std::function<void(const HeadCalibration&)> on_so_far = {};
};

/// Measurements by a head and its camera while the head moves.
struct HeadCalibration {
  std::string url, stream;
  int width_px = 0, height_px = 0;
  std::size_t num_frames = 0, num_moves = 0;
  std::size_t num_skipped = 0;  ///< Number of frames in which points could not be tracked in time.
  FrameTimes times = FrameTimes::arrival;
  double sigma_frame_s = 0.0;  ///< σ of a frame's time, apart from a delay common to all.
  std::size_t num_jumps = 0;   ///< Jumps of the time stamps, which were then not used; 0: none, or no stamps.
  double largest_jump_s = 0.0;
  double head_time_s = 0.0;
  double sigma_clock_s =
      0.0;  ///< σ of the head's times against the frames'; part of σ of the delay, beside the log's share.
  double answer_s = 0.0;             ///< Median response time of the head.
  bool has_seen_points = false;      ///< In some frame, whether or not the angle of the head is known for it.
  double sigma_angle_rad = 0.0;      ///< Estimated noise of the readings (including rounding); 0: none.
  bool is_of_shots = false;          ///< Single images with the head at rest; otherwise video.
  double narrow_focal_px = 0.0;      ///< Above zero: the field is so narrow that only one focal length is observable.
  std::string fault;                 ///< Failure during the run; the head was stopped, and the results are from before.
  std::string log_csv;               ///< Input of `offline`, as log.csv.
  std::vector<std::string> offline;  ///< `alidade` with these arguments, run beside log.csv, gives the same numbers.
  ObserveReport report;
  Verdict verdict;
};

/// The arguments for `HeadCalibration::offline`.
[[nodiscard]] std::vector<std::string> offline_words(const HeadCalibration& result);
/// Concatenates two logs of one head and camera; points are not shared between them.
[[nodiscard]] RotationLog joined_logs(const RotationLog& before, const RotationLog& now);

/// Moves the head, tracks points in its camera's images, and estimates until the goal or the time limit is reached;
/// moves are planned from the estimate so far. Throws InputError, Interrupted, with the head stopped.
[[nodiscard]] HeadCalibration calibrate_head(HeadDevice& device, FrameStream& stream,
                                             const HeadCalibrationConfig& config, const Progress& progress = {});

}  // namespace alidade
