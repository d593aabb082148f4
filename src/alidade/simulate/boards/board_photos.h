#pragma once

#include <cstdint>
#include <vector>

#include "alidade/board/board.h"
#include "alidade/board/board_view.h"
#include "alidade/camera/camera.h"
#include "alidade/geometry/rigid3.h"

namespace cv {
class Mat;
}

namespace alidade {

/// A world for `calibrate`: a camera, a board with its true points, and the poses in which the board was held.
struct BoardScene {
  Camera camera;
  Board board;
  std::vector<Eigen::Vector3d> points_in_board;  ///< True points [m]: flat, bowed, or free.
  std::vector<Rigid3> cam_from_board;            ///< One per photo.
  double autofocus = 0.0;  ///< Relative increase of the focal length from infinity to half a metre: as 1/z.
};

/// The camera in photo `i`, with the focal length at the board's distance.
[[nodiscard]] Camera camera_of(const BoardScene& scene, std::size_t i);

struct BoardSceneConfig {
  int num_photos = 20;
  double max_tilt_rad = 0.6;
  double min_fill = 0.35, max_fill = 0.9;  ///< Printed size over image size, along the fuller axis.
  double bow_m = 0.0;                      ///< Height of the board's centre over its corners, away from the camera. [m]
  double shape_sigma_m = 0.0;              ///< Scatter of every point, in and out of plane. [m]
  bool into_corners = false;  ///< Every other photo has the board in a corner of the image, as users are advised.
};

/// Draws a scene in which every point of every board is in view. Same seed, same scene. Tilts, rolls, positions in the
/// image and distances vary; if a drawn pose does not fit, the board is moved away.
[[nodiscard]] BoardScene draw_board_scene(const Camera& camera, const Board& board, const BoardSceneConfig& config,
                                          std::uint64_t seed);

/// Name of photo `i`: board_001.png for the first.
[[nodiscard]] std::string photo_name(std::size_t i);

/// True pixels of the board's points in photo `i`, in the board's order.
[[nodiscard]] std::vector<Eigen::Vector2d> true_corners(const BoardScene& scene, std::size_t i);

/// Corners without images: truth plus normal noise of `sigma_px` per coordinate, with that covariance.
[[nodiscard]] std::vector<BoardView> simulate_views(const BoardScene& scene, double sigma_px, std::uint64_t seed);

/// Moves the corners of each view by a smooth field over the board, drawn anew for each view: a quadratic polynomial
/// per coordinate, each of whose terms has σ `sigma_px` at the board's border. It imitates blur, rolling shutter, a
/// flexing board or an insufficient lens model: errors that a photo's corners share.
void add_shared_errors(const BoardScene& scene, double sigma_px, std::uint64_t seed, std::vector<BoardView>& views);

struct RenderConfig {
  double blur_px = 0.6;  ///< σ of the optical blur.
  double noise = 2.0;    ///< σ of the grey noise, in grey values of 255.
  double black = 40.0, white = 210.0;
  double gradient = 0.0;            ///< Relative fall of light from the left to the right edge.
  double background_texture = 1.0;  ///< 0: uniform grey behind the board; 1: gentle waves.
  int oversampling = 4;             ///< Sub-samples per pixel and axis near edges, each the mean over its area.
};

/// Photo `i` of the scene, 8-bit grey, rendered by casting rays through the lens on the (curved) board: the print's
/// light, blurred by the optics, integrated over each pixel, with noise, rounded. Edges are within 0.002 px of their
/// projection (tested). `seed` determines the noise, which differs between photos.
[[nodiscard]] cv::Mat render_board_photo(const BoardScene& scene, std::size_t i, const RenderConfig& config,
                                         std::uint64_t seed);

}  // namespace alidade
