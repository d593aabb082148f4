#include "bench_scenes.h"

#include <fmt/format.h>

#include <cstdio>
#include <opencv2/imgproc.hpp>

#include "alidade/simulate/example_camera.h"

namespace alidade::bench {

std::string name_of(const SolveCase& c) { return fmt::format("{}x{}x{}", c.cols, c.rows, c.num_photos); }

std::optional<SolveCase> parse_case(std::string_view text) {
  SolveCase c;
  const std::string copy(text);
  if (std::sscanf(copy.c_str(), "%dx%dx%d", &c.cols, &c.rows, &c.num_photos) != 3) return std::nullopt;
  return c;
}

std::vector<SolveCase> all_cases() { return {{9, 6, 20}, {9, 6, 100}, {9, 6, 500}, {9, 6, 2000}, {20, 14, 2000}}; }

Corners draw_corners(const SolveCase& c) {
  const Camera camera = *example_camera("brown", 1280, 960);
  BoardSceneConfig config;
  config.num_photos = c.num_photos;
  const BoardScene scene = draw_board_scene(camera, Board{BoardKind::chessboard, c.cols, c.rows}, config, 1);
  constexpr double sigma_px = 0.1;  // what a good detector leaves
  return {scene.board, {camera.width_px, camera.height_px}, simulate_views(scene, sigma_px, 2)};
}

cv::Mat vga_photo_with_board(std::uint64_t seed) {
  BoardSceneConfig config;
  config.num_photos = 1;
  const BoardScene scene = draw_board_scene(*example_camera("brown", 640, 480), Board{}, config, seed);
  return render_board_photo(scene, 0, RenderConfig{}, seed);
}

cv::Mat megapixel_photo_without_board() {
  cv::RNG random(3);
  cv::Mat sum = cv::Mat::zeros(800, 1280, CV_32F);
  for (int blot_px = 1; blot_px <= 64; blot_px *= 2) {
    cv::Mat layer(800, 1280, CV_32F);
    random.fill(layer, cv::RNG::NORMAL, 0.0, 1.0);
    cv::GaussianBlur(layer, layer, {}, blot_px);
    layer *= 2.0 * blot_px;  // undoes what the blur took from the contrast
    if (blot_px == 16) cv::threshold(layer, layer, 0.0, 2.0, cv::THRESH_BINARY);
    sum += layer;
  }
  cv::Mat noise(sum.size(), CV_32F);
  random.fill(noise, cv::RNG::NORMAL, 0.0, 2.0);
  cv::normalize(sum, sum, 20.0, 235.0, cv::NORM_MINMAX);
  cv::Mat photo;
  sum += noise;
  sum.convertTo(photo, CV_8U);
  return photo;
}

}  // namespace alidade::bench
