#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "alidade/simulate/boards/board_light.h"
#include "alidade/simulate/boards/board_photos.h"
#include "alidade/simulate/draws.h"

namespace alidade {

cv::Mat render_board_photo(const BoardScene& scene, std::size_t i, const RenderConfig& config, std::uint64_t seed) {
  const PixelLight light = BoardLight(scene, i, config, seed).ambient();
  Draws draws(seed + 0x9e3779b97f4a7c15u * (i + 1));
  cv::Mat photo(scene.camera.height_px, scene.camera.width_px, CV_8U);
  for (int v = 0; v < photo.rows; ++v) {
    auto* row = photo.ptr<unsigned char>(v);
    for (int u = 0; u < photo.cols; ++u) {
      const double noisy =
          static_cast<double>(light(v, u)) + (config.noise > 0.0 ? config.noise * draws.normal() : 0.0);
      row[u] = static_cast<unsigned char>(std::lround(std::clamp(noisy, 0.0, 255.0)));
    }
  }
  return photo;
}

}  // namespace alidade
