#pragma once

#include "alidade/calibrate/checks/judge.h"
#include "alidade/simulate/boards/board_photos.h"
#include "alidade/simulate/example_camera.h"

namespace alidade::testing {

inline const Board sample_board{.cols = 9, .rows = 6, .square_m = 0.025};
inline constexpr ImageSize sample_size{640, 480};

/// The example camera, 640×480, with some parameters set again.
inline Camera sample_camera(const std::string& model, const std::vector<std::pair<std::string, double>>& changed = {}) {
  Camera camera = *example_camera(model, sample_size.width_px, sample_size.height_px);
  const auto names = param_names(camera.lens);
  Eigen::VectorXd values = params(camera.lens);
  for (const auto& [name, value] : changed) {
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (names[i] == name) values[static_cast<Eigen::Index>(i)] = value;
    }
  }
  camera.lens = with_params(camera.lens, values);
  return camera;
}

inline BoardScene sample_scene(const Camera& camera, int num_photos, std::uint64_t seed, double bow_m = 0.0) {
  BoardSceneConfig config;
  config.num_photos = num_photos;
  config.bow_m = bow_m;
  return draw_board_scene(camera, sample_board, config, seed);
}

/// Views with noise of 0.1 px a coordinate. `know_sigma` false: the corners do not bring it.
inline std::vector<BoardView> sample_views(const BoardScene& scene, std::uint64_t seed, bool know_sigma = true) {
  std::vector<BoardView> views = simulate_views(scene, 0.1, seed);
  for (BoardView& view : views) {
    for (Corner& corner : view.corners) {
      if (!know_sigma) corner.cov.setIdentity();
    }
  }
  return views;
}

/// A scene whose last four photos are where the first ones are least informative: the image is covered to its corners.
inline BoardScene covered_scene(const Camera& camera, int num_photos, std::uint64_t seed, double bow_m = 0.0) {
  BoardScene scene = sample_scene(camera, num_photos - 4, seed, bow_m);
  const CalibrateConfig config{.model = std::string(model_name(camera.lens))};
  const auto report = calibrate(sample_board, simulate_views(scene, 0.1, seed), sample_size, config);
  for (const NextPhoto& photo : plan_next_photos(report.camera, 0.1, points_in_board(sample_board), 4).photos) {
    scene.cam_from_board.push_back(photo.cam_from_board);
  }
  return scene;
}

/// The whole way of `alidade calibrate --corners`.
inline Calibration sample_calibration(std::vector<BoardView> views, const CalibrateConfig& config = {}) {
  PhotoCalibration photos;
  photos.reasons.resize(views.size());
  photos.size = sample_size;
  photos.report = calibrate(sample_board, views, sample_size, config, config.board_points);
  photos.views = std::move(views);
  return judge_calibration(sample_board, std::move(photos), config);
}

/// The check of that name. There is one.
inline const Check& check_named(const Verdict& verdict, const std::string& name) {
  for (const Check& check : verdict.checks) {
    if (check.name == name) return check;
  }
  throw std::logic_error("no check '" + name + "'");
}

}  // namespace alidade::testing
