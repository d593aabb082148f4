#include "alidade/calibrate/solve/start.h"

#include <gtest/gtest.h>

#include "alidade/calibrate/solve/homography.h"
#include "alidade/simulate/boards/board_photos.h"

namespace alidade {
namespace {

BoardScene pinhole_scene() {
  Camera camera;
  camera.width_px = 800;
  camera.height_px = 600;
  camera.lens = Calibrated<Pinhole>{{700, 720, 390, 310, 0}};
  return draw_board_scene(camera, Board{}, {.num_photos = 6}, 3);
}

std::vector<Eigen::Matrix3d> exact_homographies(const BoardScene& scene) {
  std::vector<Eigen::Matrix3d> found;
  std::vector<Eigen::Vector2d> on_board;
  for (const auto& point : points_in_board(scene.board)) on_board.emplace_back(point.head<2>());
  for (std::size_t i = 0; i < scene.cam_from_board.size(); ++i) {
    found.push_back(fit_homography(on_board, true_corners(scene, i)).value());
  }
  return found;
}

TEST(ZhangIntrinsics, AreExactWithoutNoise) {
  const BoardScene scene = pinhole_scene();
  const auto found = zhang_intrinsics(exact_homographies(scene));
  ASSERT_TRUE(found);
  EXPECT_LT((*found - Eigen::Vector4d(700, 720, 390, 310)).norm(), 1e-5);
}

TEST(FocalFromVanishingPoints, IsExactWithSquarePixelsAndTheTruePrincipalPoint) {
  BoardScene scene = pinhole_scene();
  scene.camera.lens = Calibrated<Pinhole>{{700, 700, 390, 310, 0}};
  const auto f = focal_from_vanishing_points(exact_homographies(scene), {390, 310});
  ASSERT_TRUE(f);
  EXPECT_NEAR(*f, 700.0, 1e-5);
}

TEST(PoseFromPlane, IsExactForEveryLens) {
  for (const char* model : {"pinhole", "brown", "kannala_brandt"}) {
    BoardScene scene = pinhole_scene();
    Eigen::VectorXd values = Eigen::VectorXd::Zero(params(*make_lens(model)).size());
    values.head<4>() << 700, 720, 390, 310;
    if (values.size() > 5) values[5] = -0.05;
    scene.camera.lens = with_params(*make_lens(model), values);
    for (std::size_t i = 0; i < scene.cam_from_board.size(); ++i) {
      BoardView view;
      const auto px = true_corners(scene, i);
      for (std::size_t k = 0; k < px.size(); ++k) view.corners.push_back({static_cast<int>(k), px[k]});
      const auto pose = pose_from_plane(scene.camera, view, scene.points_in_board);
      ASSERT_TRUE(pose) << model;
      EXPECT_LT((pose->translation - scene.cam_from_board[i].translation).norm(), 1e-8) << model;
      EXPECT_LT(pose->rotation.angularDistance(scene.cam_from_board[i].rotation), 1e-8) << model;
    }
  }
}

TEST(FitHomography, HasNoAnswerForPointsOnALine) {
  std::vector<Eigen::Vector2d> line, square;
  for (int i = 0; i < 8; ++i) line.emplace_back(i, 2 * i);
  for (int i = 0; i < 8; ++i) square.emplace_back(i % 3, i / 3);
  EXPECT_FALSE(fit_homography(line, square));
  EXPECT_FALSE(fit_homography(std::span(square).first(3), std::span(square).first(3)));
}

}  // namespace
}  // namespace alidade
