#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

namespace cv {
class Mat;
}

namespace alidade {

struct PointTrackerConfig {
  int max_tracks = 200;        ///< At a time; spread over the image by a grid of as many cells.
  double max_return_px = 0.3;  ///< A point followed back must end this close to where it came from.
  double max_sigma_px = 0.15;  ///< Points that would be seen less sharply are not begun, and dropped.
  double min_likeness = 0.8;   ///< Correlation with the patch as it was first seen.
  double max_stretch = 1.3;    ///< Longer or shorter by more than this, the patch is cut out again.
};

/// Where a point is seen in a frame.
struct TrackedPoint {
  int id = 0;  ///< Counts up from 0; never given twice.
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  /// σ of one coordinate by the noise of this frame, about a position that stays the same as long as the point's patch
  /// is kept: the noise of the patch itself moves all of a track by as much, which a bearing takes up.
  double sigma_px = 0.0;
};

/// Tracks static points through a video, frame by frame. Each is found by frame-to-frame flow, checked
/// forward and backward, and then aligned with its patch as first seen, rotated and stretched as needed: errors do not
/// add up along the video. What is lost is replaced by new points where the image has room.
class PointTracker {
 public:
  explicit PointTracker(const PointTrackerConfig& config = {});
  PointTracker(PointTracker&&) noexcept;
  PointTracker& operator=(PointTracker&&) noexcept;
  ~PointTracker();

  /// The next frame: one channel, 8 bits or 32-bit float of 0 to 255. An image of another size begins again.
  /// Returns what is seen in it, by id; the first frame's points are where they were chosen.
  const std::vector<TrackedPoint>& update(const cv::Mat& grey);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace alidade
