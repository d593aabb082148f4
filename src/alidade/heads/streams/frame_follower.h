#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "alidade/board/board.h"
#include "alidade/heads/streams/arrival_times.h"
#include "alidade/heads/streams/frame_stream.h"
#include "alidade/heads/turn_log.h"
#include "alidade/patches/point_tracks.h"

namespace alidade {

/// Follows points, or the corners of a board, on a thread of its own, so that the head is asked in time. Where it falls
/// behind, the newest frame is taken and those before it are skipped.
class FrameFollower {
 public:
  /// `keeps_all`: no frame is skipped; of a clock that waits for it.
  explicit FrameFollower(std::optional<Board> board = {}, bool keeps_all = false)
      : board_(std::move(board)),
        tracker_(PointTrackerConfig{.max_tracks = 120}),
        keeps_all_(keeps_all),
        worker_([this] { work(); }) {}
  ~FrameFollower();
  FrameFollower(const FrameFollower&) = delete;
  FrameFollower& operator=(const FrameFollower&) = delete;

  void push(StreamFrame frame);
  /// Those that have been looked at; waits until all have. At the times that count: their time stamps, or, where those
  /// jump, those stamps put together by when frames came.
  [[nodiscard]] std::vector<SeenFrame> seen();
  /// Without waiting.
  [[nodiscard]] std::vector<SeenFrame> seen_so_far();
  [[nodiscard]] std::size_t num_skipped();

  [[nodiscard]] const StampWatch& stamps() const { return stamps_; }
  [[nodiscard]] FrameTimes times() const { return stamps_.is_jumping() ? FrameTimes::arrival : times_; }
  [[nodiscard]] double sigma_s() const;

 private:
  struct Waiting {
    StreamFrame frame;
    std::size_t number;  ///< Of those that were pushed.
  };
  void work();
  void skip_what_is_late();
  [[nodiscard]] std::vector<TrackedPoint> points_in(const cv::Mat& grey);
  [[nodiscard]] std::vector<SeenFrame> timed() const;

  std::optional<Board> board_;
  PointTracker tracker_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Waiting> waiting_;
  std::vector<SeenFrame> seen_;
  std::vector<std::size_t> numbers_;    ///< Of those.
  std::vector<JumpingStamp> arrivals_;  ///< Of each frame that was pushed.
  bool keeps_all_, is_busy_ = false, ends_ = false;
  std::size_t num_skipped_ = 0;
  StampWatch stamps_;
  FrameTimes times_ = FrameTimes::arrival;
  double sigma_s_ = 0.0;
  std::thread worker_;  // last: it uses the others
};

}  // namespace alidade
