#pragma once

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "alidade/simulate/boards/board_photos.h"

// What makes the corners of a photo share errors, for study_shared.

namespace alidade {

constexpr double blur_px = 0.1;

/// Something that a photo's corners share, drawn again for each photo.
struct Cause {
  const char* name;
  const char* size;
  void (*spoil)(const BoardScene&, std::mt19937_64&, std::vector<BoardView>&);
  std::vector<std::string> fixed = {"skew"};
};

/// Some photos are blurred: all their corners have more noise, and nothing says so.
inline void blur(const BoardScene&, std::mt19937_64& random, std::vector<BoardView>& views) {
  std::normal_distribution<double> normal;
  for (BoardView& view : views) {
    const double more_px = blur_px * std::expm1(std::abs(normal(random)));
    for (Corner& corner : view.corners)
      for (int i = 0; i < 2; ++i) corner.px[i] += more_px * normal(random);
  }
}

/// The board moves while rows are read: corners shift in proportion to their row.
inline void shutter(const BoardScene& scene, std::mt19937_64& random, std::vector<BoardView>& views) {
  std::normal_distribution<double> normal;
  for (BoardView& view : views) {
    const double u = 0.3 * normal(random), v = 0.3 * normal(random);  // px from the first row to the last
    for (Corner& corner : view.corners) corner.px += corner.px.y() / scene.camera.height_px * Eigen::Vector2d(u, v);
  }
}

/// The board flexes with its pose, into another parabola in each photo.
inline void bow(const BoardScene& scene, std::mt19937_64& random, std::vector<BoardView>& views) {
  std::normal_distribution<double> normal;
  const Eigen::Vector3d centre = 0.5 * (scene.points_in_board.front() + scene.points_in_board.back());
  const double half_m = (scene.points_in_board.back() - centre).norm();
  for (std::size_t k = 0; k < views.size(); ++k) {
    BoardScene bent = scene;
    const double x = 0.02 * normal(random), y = 0.02 * normal(random);  // heights, of a square
    for (Eigen::Vector3d& point : bent.points_in_board) {
      const Eigen::Vector3d at = (point - centre) / half_m;
      point.z() += scene.board.square_m * (x * at.x() * at.x() + y * at.y() * at.y());
    }
    const auto is = true_corners(bent, k), was = true_corners(scene, k);
    for (Corner& corner : views[k].corners) {
      const auto i = static_cast<std::size_t>(corner.index);
      corner.px += is[i] - was[i];
    }
  }
}

inline std::vector<Cause> shared_causes() {
  return {{"blur", "a photo's noise is greater by up to several times", blur},
          {"rolling shutter", "0.3 px (1σ) from the first row to the last", shutter},
          {"a lens without k3",
           "true k3 −0.02: after k1 and k2 0.05 px at most, 0.02 RMS",
           [](const BoardScene&, std::mt19937_64&, std::vector<BoardView>&) {},
           {"skew", "k3"}},
          {"a board that bends with its pose", "0.02 squares (1σ) along each axis", bow}};
}

}  // namespace alidade
