#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

namespace cv {
class Mat;
}

namespace alidade {

/// A world at infinity, where only directions count: grey values on a sphere, stored as a cube of images whose tiles
/// are painted when first needed. Frame base: x right, y down, z forward.
class FarWorld {
 public:
  /// An isotropic texture of five octaves of noise with soft edges. The finest grains are `grain_rad` apart: with 3
  /// pixels of the camera there are corners everywhere. Same seed, same world.
  [[nodiscard]] static FarWorld of_noise(double grain_rad, std::uint64_t seed);

  /// A photo wrapped around by the Mercator projection, so that it keeps its angles: column u looks to azimuth
  /// a = (u − (width − 1) / 2) · rad_per_px to the right, row v to the height b below the horizon with
  /// asinh(tan b) = (v − (height − 1) / 2) · rad_per_px. It is mirrored beyond its edges.
  [[nodiscard]] static FarWorld of_photo(const cv::Mat& photo, double rad_per_px);

  FarWorld(FarWorld&&) noexcept;
  FarWorld& operator=(FarWorld&&) noexcept;
  ~FarWorld();

  /// Paints what is visible in these directions and up to `reach_rad` around them; on all threads.
  void prepare(const std::vector<Eigen::Vector3f>& directions, double reach_rad);

  /// Grey value, 0 to 255, of a direction that has been prepared.
  [[nodiscard]] float grey(const Eigen::Vector3f& direction) const;

 private:
  class Cube;
  explicit FarWorld(std::unique_ptr<Cube> cube);
  std::unique_ptr<Cube> cube_;
};

}  // namespace alidade
