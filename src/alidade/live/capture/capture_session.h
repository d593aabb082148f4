#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "alidade/calibrate/calibration.h"
#include "alidade/capture.h"
#include "alidade/live/capture/kept_photos.h"

namespace alidade::live {

/// One capture: images come in, photos stay on disk, and the user is informed. Knows no window and no network.
class CaptureSession {
 public:
  /// `tell`: a line for the person; said once each, however often it is found again.
  CaptureSession(const Board& board, const CaptureConfig& config, KeptPhotos photos,
                 std::function<void(const std::string&)> tell);

  /// An image, 8-bit grey, of that time [s since the capture began]. It is kept where it is to be; `file` then names
  /// it. `is_again`: it was seen before, and says nothing of the stream.
  struct Seen {
    CaptureLook look;
    std::string file;
  };
  Seen see(const cv::Mat& grey, double t_s, bool is_exact, bool is_again = false);
  /// Nothing new comes: what was shown before and is to be kept by now is.
  Seen look_back(double t_s);
  /// Kept because the person says so. Why not, or "".
  std::string take(const cv::Mat& grey, double t_s, bool is_exact);
  bool undo();
  /// Nothing is taken by itself any more, or again.
  void pause(bool is_paused) { is_paused_ = is_paused; }
  [[nodiscard]] bool is_paused() const { return is_paused_; }

  [[nodiscard]] const CaptureState& state() const { return guide_.state(); }
  [[nodiscard]] CaptureGuide& guide() { return guide_; }
  [[nodiscard]] const KeptPhotos& kept() const { return kept_; }
  [[nodiscard]] double begin_s() const { return begin_s_; }  ///< Time at which it goes on; 0 for a new one.

  /// Whether the goal holds by the whole job, on the photos as they stand on disk, and its tests pass. Asked after each
  /// photo; works only where the guide thinks so.
  [[nodiscard]] bool reached_goal(const Progress& progress);

 private:
  /// Keeps what a look says is to be kept.
  void act(Seen& seen, const cv::Mat& grey, double t_s, bool is_exact);
  void note(const CaptureLook& look, const cv::Mat& grey, double t_s);
  void tell_once(const std::string& line);
  std::string keep(const cv::Mat& grey, double t_s, bool is_exact);

  Board board_;
  CaptureConfig config_;
  CaptureGuide guide_;
  KeptPhotos kept_;
  std::function<void(const std::string&)> tell_;
  std::vector<std::string> given_;
  bool is_paused_ = false, has_warned_ = false;
  bool all_exact_ = true;  ///< All images so far: which of them an earlier one was is not asked.
  double begin_s_ = 0.0;
  std::size_t checked_at_ = 0;  ///< Photos when the whole job was last run.
  std::optional<double> board_seen_s_, same_since_s_;
  int num_same_ = 0, num_other_ = 0;
  std::uint64_t last_sum_ = 0;
};

}  // namespace alidade::live
