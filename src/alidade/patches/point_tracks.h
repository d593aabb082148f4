#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

namespace cv {
class Mat;
}

namespace alidade {

struct PointTrackerConfig {
  int max_tracks = 200;        ///< At any time; spread over the image by a grid with as many cells.
  double max_return_px = 0.3;  ///< Maximum distance from the origin after tracking back.
  double max_sigma_px = 0.15;  ///< Points with a larger σ are not started, and are dropped.
  double min_likeness = 0.8;   ///< Correlation with the patch as first seen.
  double max_stretch = 1.3;    ///< With a larger stretch, the patch is cut out again.
};

/// Observation of a tracked point in a frame.
struct TrackedPoint {
  int id = 0;  ///< Counts up from 0; never reused.
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  /// σ of one coordinate by the noise of this frame, about a position that is constant as long as the point's patch is
  /// kept: the noise of the patch itself shifts a whole track by a constant, which a bearing absorbs.
  double sigma_px = 0.0;
};

/// Tracks static points through a video, frame by frame. Each is located by frame-to-frame flow, checked forward and
/// backward, and then aligned with its patch as first seen, rotated and stretched as needed: errors do not accumulate.
/// Lost points are replaced by new ones where the image has room.
class PointTracker {
 public:
  explicit PointTracker(const PointTrackerConfig& config = {});
  PointTracker(PointTracker&&) noexcept;
  PointTracker& operator=(PointTracker&&) noexcept;
  ~PointTracker();

  /// The next frame: one channel, 8 bits or 32-bit float of 0 to 255. An image of another size restarts the tracker.
  /// Returns the points seen in it, by id; those of the first frame are where they were selected.
  const std::vector<TrackedPoint>& update(const cv::Mat& grey);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace alidade
