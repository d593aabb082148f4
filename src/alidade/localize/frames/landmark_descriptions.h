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

/// An observation of a landmark.
struct LandmarkSeen {
  long id = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
};

/// Descriptions of images along a path around their landmarks, for recognition from any place: binary descriptors of E.
/// Rublee, V. Rabaud, K. Konolige & G. Bradski, "ORB: an efficient alternative to SIFT or SURF", ICCV 2011, without
/// rotation: on return, the camera is usually held in a similar way.
class LandmarkDescriptions {
 public:
  static constexpr std::size_t max_images = 400;  ///< Beyond that, every second one is removed.

  /// Adds an 8-bit grey image, the `frame`-th. Landmarks too near its edge are not described.
  void add(const cv::Mat& grey, std::size_t frame, std::span<const LandmarkSeen> landmarks);

  /// Landmarks of earlier images that this one may show, one list per image, most matches first; at most `most` lists,
  /// each of at least `least`. Some are wrong. Images from `before` on are not compared.
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
    std::vector<Described> landmarks;  ///< Each at two scales.
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
