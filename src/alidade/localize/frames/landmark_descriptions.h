#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace cv {
class Mat;
}

namespace alidade {

/// A landmark in an image.
struct LandmarkSeen {
  long id = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
};

/// What images of a path looked like around their landmarks, to find these again from anywhere: binary descriptors of
/// E. Rublee, V. Rabaud, K. Konolige & G. Bradski, "ORB: an efficient alternative to SIFT or SURF", ICCV 2011, not
/// rotated: who comes back holds the camera much alike.
class LandmarkDescriptions {
 public:
  static constexpr std::size_t max_images = 400;  ///< Of more every second one leaves.

  /// Of an 8-bit grey image, the `frame`-th. Landmarks too near its edge are not described.
  void add(const cv::Mat& grey, std::size_t frame, std::span<const LandmarkSeen> landmarks);

  /// Landmarks of earlier images that this one seems to show, image by image, those that match most first, at most
  /// `most` lists, each of at least `least`. Some are wrong. Images of `before` and later are not compared.
  [[nodiscard]] std::vector<std::vector<LandmarkSeen>> matches(const cv::Mat& grey, std::size_t before,
                                                               std::size_t least, std::size_t most) const;

 private:
  using Descriptor = std::array<std::uint64_t, 4>;
  struct Described {
    long id = 0;
    Descriptor descriptor = {};
  };
  struct Image {
    std::size_t frame = 0;
    std::vector<Described> landmarks;  ///< Each in two sizes.
  };
  struct Corner {
    Eigen::Vector2d px = Eigen::Vector2d::Zero();
    Descriptor descriptor = {};
  };
  [[nodiscard]] static std::vector<Corner> corners_of(const cv::Mat& grey);
  [[nodiscard]] static std::vector<LandmarkSeen> matched(const Image& image, std::span<const Corner> corners);

  std::vector<Image> images_;
};

}  // namespace alidade
