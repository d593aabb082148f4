#include "alidade/simulate/films/spot_photos.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "alidade/imaging/image_codecs.h"
#include "alidade/simulate/boards/board_light.h"
#include "alidade/simulate/boards/board_placing.h"
#include "alidade/simulate/boards/board_surface.h"
#include "alidade/simulate/boards/printed_pattern.h"
#include "alidade/simulate/draws.h"

namespace alidade {
namespace {

constexpr double beam_reach = 1.4;  // diameters from the axis; there the light is exp(−8 · 1.4²) = 1.5e-7 of the peak

/// A pose in which the beam hits the board at `range_m`, at a random point and tilt.
Rigid3 draw_hit(const SpotScene& scene, double range_m, const SpotSceneConfig& config, Draws& draws) {
  const PrintedPattern pattern(scene.boards.board);
  const Eigen::Vector2d low = pattern.print_min(), high = pattern.print_max();
  const double y = draws.uniform(low.y(), high.y()), x = draws.uniform(low.x(), high.x());
  const double tilt = config.max_tilt_rad * std::sqrt(draws.uniform());
  const double azimuth = draws.uniform(0.0, 2.0 * std::numbers::pi), roll = draws.uniform(-0.35, 0.35);
  const Eigen::Vector3d axis(std::cos(azimuth), std::sin(azimuth), 0.0);
  const Eigen::Vector3d hit_in_board = BoardSurface(scene.boards.board, scene.boards.points_in_board).point({x, y});
  Rigid3 cam_from_board;
  cam_from_board.rotation = exp_so3(tilt * axis) * exp_so3({0.0, 0.0, roll});
  cam_from_board.translation =
      scene.beam_origin_in_cam + range_m * scene.beam_direction_in_cam - cam_from_board.rotation * hit_in_board;
  return cam_from_board;
}

/// A beam in frame board, with its light at the hit.
struct BeamOnBoard {
  Eigen::Vector3d hit, direction;
  double diameter_m, peak;

  [[nodiscard]] double light(const Eigen::Vector3d& point_in_board) const {
    const double ratio = (point_in_board - hit).cross(direction).squaredNorm() / (diameter_m * diameter_m);
    return ratio > beam_reach * beam_reach ? 0.0 : peak * std::exp(-8.0 * ratio);
  }
};

/// Pixels that the beam's light can reach where it falls on the board's plane through the hit.
PixelRect lit_rect(const Camera& camera, const Rigid3& cam_from_board, const BeamOnBoard& beam, int blur_reach) {
  const Eigen::Vector3d side = beam.direction.unitOrthogonal(), other = beam.direction.cross(side);
  Eigen::Array2d low(camera.width_px, camera.height_px), high = -low;
  constexpr int steps = 24;
  for (int k = 0; k < steps; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / steps;
    const Eigen::Vector3d offset =
        1.1 * beam_reach * beam.diameter_m * (std::cos(angle) * side + std::sin(angle) * other);
    const Eigen::Vector3d edge_in_board = beam.hit + offset - offset.z() / beam.direction.z() * beam.direction;
    const auto px = project(camera, cam_from_board * edge_in_board);
    if (!px) continue;
    low = low.min(px->array());
    high = high.max(px->array());
  }
  const int margin = blur_reach + 2;
  low = (low - margin).max(0.0);
  high = (high + margin + 1).min(Eigen::Array2d(camera.width_px, camera.height_px));
  if (!(low < high).all()) return {};
  return {static_cast<int>(low.x()), static_cast<int>(low.y()), static_cast<int>(high.x()), static_cast<int>(high.y())};
}

}  // namespace

std::optional<SpotScene> draw_spot_scene(const Camera& camera, const Board& board,
                                         const Eigen::Vector3d& beam_origin_in_cam,
                                         const Eigen::Vector3d& beam_direction_in_cam, const SpotSceneConfig& config,
                                         std::uint64_t seed) {
  Draws draws(seed);
  BoardSceneConfig shape;
  shape.bow_m = config.bow_m;
  shape.shape_sigma_m = config.shape_sigma_m;
  SpotScene scene{{camera, board, draw_bent_points(board, shape, draws), {}},
                  beam_origin_in_cam,
                  beam_direction_in_cam.normalized(),
                  {}};
  const std::vector<Eigen::Vector3d> outline = visible_outline(scene.boards);
  constexpr int max_tries = 5000;  // a photo; of a board that fills half of the image one in ten fits
  for (int i = 0; i < config.num_photos; ++i) {
    for (int tries = 0; scene.range_m.size() <= static_cast<std::size_t>(i); ++tries) {
      if (tries == max_tries) return std::nullopt;
      const double range_m = draws.uniform(config.min_range_m, config.max_range_m);
      const Rigid3 cam_from_board = draw_hit(scene, range_m, config, draws);
      if (!sees_all(camera, cam_from_board, outline)) continue;
      scene.boards.cam_from_board.push_back(cam_from_board);
      scene.range_m.push_back(range_m);
    }
  }
  return scene;
}

Eigen::Vector3d spot_in_cam(const SpotScene& scene, std::size_t i) {
  return scene.beam_origin_in_cam + scene.range_m[i] * scene.beam_direction_in_cam;
}

std::optional<Eigen::Vector2d> true_spot(const SpotScene& scene, std::size_t i) {
  return project(scene.boards.camera, spot_in_cam(scene, i));
}

struct SpotStudio::Parts {
  Camera camera;
  Rigid3 cam_from_board;
  RenderConfig config;
  BoardLight board;
  PixelLight ambient;
  std::array<PixelLight, 3> laser;  ///< Blue, green, red.
};

SpotStudio::SpotStudio(const BoardScene& boards, std::size_t i, const RenderConfig& config, std::uint64_t seed)
    : parts_(new Parts{boards.camera, boards.cam_from_board[i], config, BoardLight(boards, i, config, seed), {}, {}}) {
  parts_->ambient = parts_->board.ambient();
  clear();
}

SpotStudio::~SpotStudio() = default;
SpotStudio::SpotStudio(SpotStudio&&) noexcept = default;

void SpotStudio::clear() {
  for (PixelLight& channel : parts_->laser) channel.setZero(parts_->ambient.rows(), parts_->ambient.cols());
}

void SpotStudio::add_spot(const Eigen::Vector3d& hit_in_cam, const Eigen::Vector3d& direction_in_cam, double range_m,
                          const LaserLight& laser) {
  const Rigid3 board_from_cam = parts_->cam_from_board.inverse();
  BeamOnBoard beam{board_from_cam * hit_in_cam, board_from_cam.rotation * direction_in_cam.normalized(), 0.0, 0.0};
  beam.diameter_m = laser.diameter_m + laser.divergence_rad * range_m;
  const double growth = beam.diameter_m / (laser.diameter_m + laser.divergence_rad);  // since 1 m
  beam.peak = laser.peak * std::abs(beam.direction.z()) / (growth * growth);          // Lambert's cosine
  const PixelRect rect = lit_rect(parts_->camera, parts_->cam_from_board, beam, parts_->board.blur_reach());
  if (rect.is_empty()) return;
  const double ink_albedo = parts_->config.black / parts_->config.white;
  const PixelLight light =
      parts_->board.added(rect, ink_albedo, [&](const Eigen::Vector3d& point) { return beam.light(point); });
  const std::size_t strongest = laser.colour == LaserColour::red ? 2 : 1;
  for (std::size_t channel = 0; channel < 3; ++channel) {
    const auto share = static_cast<float>(channel == strongest ? 1.0 : laser.leak);
    parts_->laser[channel].block(rect.v_min, rect.u_min, light.rows(), light.cols()) += share * light;
  }
}

cv::Mat SpotStudio::photo(double exposure, std::uint64_t noise_seed) const {
  const double noise = parts_->config.noise;
  Draws draws(noise_seed);
  cv::Mat photo(parts_->camera.height_px, parts_->camera.width_px, CV_8UC3);
  for (int v = 0; v < photo.rows; ++v) {
    auto* row = photo.ptr<unsigned char>(v);
    for (int i = 0; i < 3 * photo.cols; ++i) {
      const float light = parts_->ambient(v, i / 3) + parts_->laser[static_cast<std::size_t>(i % 3)](v, i / 3);
      const double noisy = exposure * static_cast<double>(light) + (noise > 0.0 ? noise * draws.normal() : 0.0);
      row[i] = static_cast<unsigned char>(std::lround(std::clamp(noisy, 0.0, 255.0)));
    }
  }
  return photo;
}

void SpotStudio::add_speckle(double contrast, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::gamma_distribution<double> grain(1.0 / (contrast * contrast), contrast * contrast);
  const auto& first = parts_->laser[0];
  for (Eigen::Index v = 0; v < first.rows(); ++v)
    for (Eigen::Index u = 0; u < first.cols(); ++u) {
      const auto by = static_cast<float>(grain(random));
      for (PixelLight& channel : parts_->laser) channel(v, u) *= by;
    }
}

namespace {

/// One colour a pixel, and what a camera makes of it.
cv::Mat through_bayer(const cv::Mat& photo) {
  cv::Mat raw(photo.size(), CV_8U), colour;
  for (int v = 0; v < photo.rows; ++v)
    for (int u = 0; u < photo.cols; ++u)
      raw.at<unsigned char>(v, u) = photo.at<cv::Vec3b>(v, u)[v % 2 == u % 2 ? (v % 2 == 0 ? 2 : 0) : 1];
  cv::cvtColor(raw, colour, cv::COLOR_BayerBG2BGR);
  return colour;
}

cv::Mat through_jpeg(const cv::Mat& photo, int quality) { return decode_image(jpeg_bytes(photo, quality)); }

/// Points of the board that carry stickers, the same in all photos.
std::vector<Eigen::Vector3d> stickers_in_cam(const SpotScene& scene, std::size_t i, int num) {
  std::vector<Eigen::Vector3d> places;
  Draws draws(4711);
  const Eigen::Vector3d last = scene.boards.points_in_board.back();
  for (int k = 0; k < num; ++k) {
    const Eigen::Vector3d at(draws.uniform(0.1, 0.9) * last.x(), draws.uniform(0.1, 0.9) * last.y(), 0.0);
    places.emplace_back(scene.boards.cam_from_board[i] * at);
  }
  return places;
}

}  // namespace

cv::Mat as_camera_saves(const cv::Mat& photo, bool is_bayer, int jpeg_quality) {
  const cv::Mat seen = is_bayer ? through_bayer(photo) : photo;
  return jpeg_quality > 0 ? through_jpeg(seen, jpeg_quality) : seen;
}

cv::Mat render_spot_photo(const SpotScene& scene, std::size_t i, const SpotPhotoConfig& config, std::uint64_t seed) {
  SpotStudio studio(scene.boards, i, config.render, seed);
  const std::uint64_t own_seed = seed + 0x9e3779b97f4a7c15u * (2 * i + (config.is_on ? 1 : 2));
  std::vector<Eigen::Vector3d> hits = config.stray_in_cam;
  hits.push_back(spot_in_cam(scene, i));
  for (const Eigen::Vector3d& hit_in_cam : hits) {
    if (config.is_on) studio.add_spot(hit_in_cam, scene.beam_direction_in_cam, scene.range_m[i], config.laser);
  }
  if (config.speckle > 0.0) studio.add_speckle(config.speckle, own_seed + 1);
  for (const Eigen::Vector3d& place : stickers_in_cam(scene, i, config.num_stickers))
    studio.add_spot(place, scene.beam_direction_in_cam, 1.0, config.laser);
  return as_camera_saves(studio.photo(config.exposure, own_seed), config.is_bayer, config.jpeg_quality);
}

}  // namespace alidade
