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

/// A heavily downsampled image: the description of a place.
struct Thumbnail {
  static constexpr int width = 40, height = 30;
  std::array<float, static_cast<std::size_t>(width) * height> grey{};  ///< Mean removed.
  double energy = 0.0;                                                 ///< Σ grey²; 0: no texture.
};
[[nodiscard]] Thumbnail thumbnail_of(const cv::Mat& grey);

/// Similarity of two thumbnails and their offset: content at p in `first` is at p + shift in `second` [their px].
struct ThumbnailMatch {
  double correlation = -1.0;
  Eigen::Vector2i shift = Eigen::Vector2i::Zero();
};
[[nodiscard]] ThumbnailMatch match_thumbnails(const Thumbnail& first, const Thumbnail& second);

/// Images with known poses, sufficiently far apart from each other. B. Williams, G. Klein & I. Reid, "Automatic
/// Relocalization and Loop Closing for Real-Time Monocular SLAM", PAMI 33(9), 2011; thumbnails: G. Klein & D. Murray,
/// "Improving the Agility of Keyframe-Based SLAM", ECCV 2008.
class KeyframeStore {
 public:
  /// Adds a keyframe, unless one is within `near_m` and `near_rad`. `step`: index in the path.
  void offer(const cv::Mat& grey, const Rigid3& world_from_cam, double near_m, double near_rad, std::size_t step = 0);
  /// Adds a keyframe of a saved map.
  void add(const SavedKeyframe& saved);
  /// All keyframes, with their poses from the current path.
  [[nodiscard]] std::vector<SavedKeyframe> saved(std::span<const PathStep> path) const;
  /// Candidate poses for an image, most likely first: those of the most similar keyframes, rotated by the shift between
  /// the images.
  [[nodiscard]] std::vector<Rigid3> candidates(const cv::Mat& grey, const Camera& camera, std::size_t most) const;
  [[nodiscard]] std::size_t size() const { return keyframes_.size(); }

 private:
  struct Keyframe {
    Rigid3 world_from_cam;
    Thumbnail thumbnail;
    std::optional<std::size_t> step = {};  ///< Empty: from an earlier run.
  };
  std::vector<Keyframe> keyframes_;
};

}  // namespace alidade
