#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "alidade/simulate/boards/board_photos.h"

namespace alidade {

/// A world for `rangefinder`: boards before a camera, each hit by the same laser beam, X(L) = origin + L · direction.
struct SpotScene {
  BoardScene boards;
  Eigen::Vector3d beam_origin_in_cam = Eigen::Vector3d::Zero();      ///< Where the range is zero. [m]
  Eigen::Vector3d beam_direction_in_cam = Eigen::Vector3d::UnitZ();  ///< Unit length.
  std::vector<double> range_m;                                       ///< True range, one per photo.
};

struct SpotSceneConfig {
  int num_photos = 18;
  double min_range_m = 0.5, max_range_m = 2.0;  ///< Ranges are drawn evenly between them.
  double max_tilt_rad = 0.7;
  double bow_m = 0.0, shape_sigma_m = 0.0;  ///< As in BoardSceneConfig.
};

/// Draws a scene in which every point of every board is seen and the beam hits the print, at any point of it.
/// None where no such pose is found: the beam leaves the image, or the board does not fit into it at these ranges.
[[nodiscard]] std::optional<SpotScene> draw_spot_scene(const Camera& camera, const Board& board,
                                                       const Eigen::Vector3d& beam_origin_in_cam,
                                                       const Eigen::Vector3d& beam_direction_in_cam,
                                                       const SpotSceneConfig& config, std::uint64_t seed);

/// Where the beam hits board `i`.
[[nodiscard]] Eigen::Vector3d spot_in_cam(const SpotScene& scene, std::size_t i);
/// Its pixel. None where the camera does not see it.
[[nodiscard]] std::optional<Eigen::Vector2d> true_spot(const SpotScene& scene, std::size_t i);

enum class LaserColour { red, green };

/// The laser's light: a Gaussian beam of constant power.
struct LaserLight {
  LaserColour colour = LaserColour::red;
  double peak = 300.0;  ///< What the centre of the spot adds to its colour's channel, in grey values, on white paper
                        ///< that faces the beam at 1 m, before blur. More power than 255 saturates.
  double diameter_m = 0.007;       ///< Where the light has fallen to 1/e², at the origin. [m]
  double divergence_rad = 0.0005;  ///< Growth of the diameter with the range.
  double leak = 0.12;              ///< Share of it that the other two channels see.
};

struct SpotPhotoConfig {
  RenderConfig render;
  LaserLight laser;
  double exposure = 1.0;                      ///< Factor on all light, as of another exposure time.
  bool is_on = true;                          ///< False: the same photo with the laser off.
  std::vector<Eigen::Vector3d> stray_in_cam;  ///< Further points lit like the spot, as a reflection would.
  int num_stickers = 0;   ///< Coloured like the laser, at fixed points of the board; there with the laser off, too.
  double speckle = 0.0;   ///< Contrast of the laser's speckle: σ over mean of its light in a grain of a pixel.
  bool is_bayer = false;  ///< A sensor with one colour a pixel (RGGB), the others interpolated.
  int jpeg_quality = 0;   ///< Compressed and opened again, as a camera's photo; 0: not.
};

/// The light of one photo, kept so that many photos with other spots and other noise cost little.
class SpotStudio {
 public:
  SpotStudio(const BoardScene& boards, std::size_t i, const RenderConfig& config, std::uint64_t seed);
  ~SpotStudio();
  SpotStudio(SpotStudio&&) noexcept;

  /// Adds a spot of a beam through `hit_in_cam`, a point of the board, of which `range_m` is the range.
  void add_spot(const Eigen::Vector3d& hit_in_cam, const Eigen::Vector3d& direction_in_cam, double range_m,
                const LaserLight& laser);
  /// Takes all spots away.
  void clear();
  /// Grains of a pixel of the laser's light are dark and bright: gamma distributed, as sums of speckle are.
  void add_speckle(double contrast, std::uint64_t seed);
  /// 8-bit BGR: light times exposure, noise, clipped at 255, rounded.
  [[nodiscard]] cv::Mat photo(double exposure, std::uint64_t noise_seed) const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// The photo through a sensor with one colour a pixel (RGGB, the others interpolated bilinearly), and JPEG of this
/// quality (colours at half the resolution, 4:2:0; 0: not compressed).
[[nodiscard]] cv::Mat as_camera_saves(const cv::Mat& photo, bool is_bayer, int jpeg_quality);

/// Photo `i` of the scene in colour, 8-bit BGR: render_board_photo()'s grey print in white light and the laser's spot.
/// The beam's light falls on the print, foreshortened by its tilt and returned by paper and ink as they return white
/// light; it is blurred and integrated with them, and what exceeds 255 is cut off. The spot's true pixel is
/// true_spot(). A photo with the laser on and one with it off differ in the laser's light and the noise alone.
[[nodiscard]] cv::Mat render_spot_photo(const SpotScene& scene, std::size_t i, const SpotPhotoConfig& config,
                                        std::uint64_t seed);

}  // namespace alidade
