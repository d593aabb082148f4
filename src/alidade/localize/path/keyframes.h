#pragma once

#include <array>
#include <span>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/geometry/rigid3.h"
#include "alidade/localize/localization.h"

namespace cv {
class Mat;
}

namespace alidade {

/// An image made very small: what is remembered of a place.
struct Thumbnail {
  static constexpr int width = 40, height = 30;
  std::array<float, static_cast<std::size_t>(width) * height> grey{};  ///< Without mean.
  double energy = 0.0;                                                 ///< Σ grey²; 0: nothing to be seen.
};
[[nodiscard]] Thumbnail thumbnail_of(const cv::Mat& grey);

/// How alike two of them are, and how far apart: what is at p in `first` is at p + shift in `second`, in their pixels.
struct ThumbnailMatch {
  double correlation = -1.0;
  Eigen::Vector2i shift = Eigen::Vector2i::Zero();
};
[[nodiscard]] ThumbnailMatch match_thumbnails(const Thumbnail& first, const Thumbnail& second);

/// Images whose pose was known, far enough from each other. B. Williams, G. Klein & I. Reid, "Automatic
/// Relocalization and Loop Closing for Real-Time Monocular SLAM", PAMI 33(9), 2011; thumbnails: G. Klein & D. Murray,
/// "Improving the Agility of Keyframe-Based SLAM", ECCV 2008.
class KeyframeStore {
 public:
  /// Keeps it if none is near: `near_m` and `near_rad` away. `step`: of the path.
  void offer(const cv::Mat& grey, const Rigid3& world_from_cam, double near_m, double near_rad, std::size_t step = 0);
  /// Those of a map that was saved.
  void add(const SavedKeyframe& saved);
  /// All, where the path now says that they were taken.
  [[nodiscard]] std::vector<SavedKeyframe> saved(std::span<const PathStep> path) const;
  /// Poses from which an image may have been taken, the likeliest first: those of the keyframes most like it, rotated
  /// by the shift of the image.
  [[nodiscard]] std::vector<Rigid3> candidates(const cv::Mat& grey, const Camera& camera, std::size_t most) const;
  [[nodiscard]] std::size_t size() const { return keyframes_.size(); }

 private:
  struct Keyframe {
    Rigid3 world_from_cam;
    Thumbnail thumbnail;
    std::optional<std::size_t> step = {};  ///< None: of an earlier run.
  };
  std::vector<Keyframe> keyframes_;
};

}  // namespace alidade
