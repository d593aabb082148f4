#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "alidade/simulate/boards/board_photos.h"

namespace alidade {

/// A world for `rangefinder`: boards in front of a camera, each hit by the same beam, X(L) = origin + L · direction.
struct SpotScene {
  BoardScene boards;
  Eigen::Vector3d beam_origin_in_cam = Eigen::Vector3d::Zero();      ///< Point of zero range. [m]
  Eigen::Vector3d beam_direction_in_cam = Eigen::Vector3d::UnitZ();  ///< Unit length.
  std::vector<double> range_m;                                       ///< True range, one per photo.
};

struct SpotSceneConfig {
  int num_photos = 18;
  double min_range_m = 0.5, max_range_m = 2.0;  ///< Ranges are drawn uniformly between them.
  double max_tilt_rad = 0.7;
  double bow_m = 0.0, shape_sigma_m = 0.0;  ///< As in BoardSceneConfig.
};

/// Draws a scene in which every point of every board is in view and the beam hits the print, at any point. None if no
/// such pose is found: the beam leaves the image, or the board does not fit into it at these ranges.
[[nodiscard]] std::optional<SpotScene> draw_spot_scene(const Camera& camera, const Board& board,
                                                       const Eigen::Vector3d& beam_origin_in_cam,
                                                       const Eigen::Vector3d& beam_direction_in_cam,
                                                       const SpotSceneConfig& config, std::uint64_t seed);

/// Point at which the beam hits board `i`.
[[nodiscard]] Eigen::Vector3d spot_in_cam(const SpotScene& scene, std::size_t i);
/// Pixel of that point. None if it is outside the camera's view.
[[nodiscard]] std::optional<Eigen::Vector2d> true_spot(const SpotScene& scene, std::size_t i);

enum class LaserColour { red, green };

/// The laser's light: a Gaussian beam of constant power.
struct LaserLight {
  LaserColour colour = LaserColour::red;
  double peak = 300.0;  ///< Grey values added at the spot's centre in its channel, on white paper that faces the beam
                        ///< at 1 m, before blur. More than 255 saturates.
  double diameter_m = 0.007;       ///< Diameter at 1/e² of the light, at the origin. [m]
  double divergence_rad = 0.0005;  ///< Growth of the diameter with the range.
  double leak = 0.12;              ///< Share of the light in the other two channels.
};

struct SpotPhotoConfig {
  RenderConfig render;
  LaserLight laser;
  double exposure = 1.0;                      ///< Factor on all light, for another exposure time.
  bool is_on = true;                          ///< False: the same photo with the laser off.
  std::vector<Eigen::Vector3d> stray_in_cam;  ///< Further points lit like the spot, as by reflections.
  int num_stickers = 0;   ///< Coloured like the laser, at fixed points of the board; also with the laser off.
  double speckle = 0.0;   ///< Contrast of the laser's speckle: σ over mean of the light in a grain of one pixel.
  bool is_bayer = false;  ///< A sensor with one colour per pixel (RGGB), the others interpolated.
  int jpeg_quality = 0;   ///< JPEG quality with which the photo is saved and reopened; 0: not.
};

/// The light of one photo, stored so that further photos with other spots and noise are cheap.
class SpotStudio {
 public:
  SpotStudio(const BoardScene& boards, std::size_t i, const RenderConfig& config, std::uint64_t seed);
  ~SpotStudio();
  SpotStudio(SpotStudio&&) noexcept;

  /// Adds a spot of a beam through `hit_in_cam`, a point of the board at range `range_m`.
  void add_spot(const Eigen::Vector3d& hit_in_cam, const Eigen::Vector3d& direction_in_cam, double range_m,
                const LaserLight& laser);
  /// Removes all spots.
  void clear();
  /// Makes one-pixel grains of the laser's light dark and bright: gamma distributed, as sums of speckle are.
  void add_speckle(double contrast, std::uint64_t seed);
  /// 8-bit BGR: light times exposure, noise, clipped at 255, rounded.
  [[nodiscard]] cv::Mat photo(double exposure, std::uint64_t noise_seed) const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// The photo through a sensor with one colour per pixel (RGGB, the others interpolated bilinearly), then JPEG of this
/// quality (colours at half the resolution, 4:2:0; 0: not compressed).
[[nodiscard]] cv::Mat as_camera_saves(const cv::Mat& photo, bool is_bayer, int jpeg_quality);

/// Photo `i` of the scene in colour, 8-bit BGR: render_board_photo()'s grey print in white light, with the laser's
/// spot. The beam's light on the print is foreshortened by its tilt and returned by paper and ink as white light is; it
/// is blurred and integrated with them, and clipped at 255. The spot's true pixel is true_spot(). A photo with the
/// laser on and one with it off differ in the laser's light and the noise only.
[[nodiscard]] cv::Mat render_spot_photo(const SpotScene& scene, std::size_t i, const SpotPhotoConfig& config,
                                        std::uint64_t seed);

}  // namespace alidade
