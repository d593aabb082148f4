#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "alidade/patches/point_tracks.h"

namespace cv {
class Mat;
}

namespace alidade {

/// Centres of what is small and brighter than what is around it, the brightest first.
[[nodiscard]] std::vector<Eigen::Vector2d> find_stars(const cv::Mat& grey);

/// How the stars of one image lie in another: shifted, and rotated a little.
struct StarShift {
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();      ///< Of what is at the centroid of the stars of `from`.
  std::vector<std::pair<std::size_t, std::size_t>> pairs;  ///< Of `from`, of `to`.
};

/// None: too few stars agree, or another shift does about as well.
[[nodiscard]] std::optional<StarShift> shift_of_stars(std::span<const Eigen::Vector2d> from,
                                                      std::span<const Eigen::Vector2d> to);

/// Stars in images that overlap, each by its number: found again by how all of them lie.
class StarTracks {
 public:
  /// The stars of an image that was taken at `pan_tilt_rad`; `near` of those that were taken nearest are looked at.
  /// Empty: none that were seen before are in it, and it is not the first; it is then not kept.
  [[nodiscard]] std::vector<TrackedPoint> update(std::vector<Eigen::Vector2d> stars,
                                                 const Eigen::Vector2d& pan_tilt_rad);
  /// From the image before the newest to the newest.
  [[nodiscard]] std::optional<StarShift> last_shift() const;

 private:
  struct Image {
    Eigen::Vector2d pan_tilt_rad;
    std::vector<Eigen::Vector2d> stars;
    std::vector<int> ids;
  };
  std::vector<Image> images_;
  int next_id_ = 0;
};

}  // namespace alidade
