#include "alidade/simulate/films/spot_photos.h"

#include <gtest/gtest.h>

#include <numbers>
#include <opencv2/core.hpp>

#include "alidade/simulate/boards/board_light.h"
#include "alidade/simulate/boards/board_surface.h"
#include "alidade/simulate/boards/printed_pattern.h"
#include "alidade/simulate/example_camera.h"

namespace alidade {
namespace {

const Board board{BoardKind::chessboard, 6, 4, 0.05, 0.0, ""};
const Eigen::Vector3d beam_origin_in_cam(0.08, -0.02, 0.01);
const Eigen::Vector3d beam_direction_in_cam = Eigen::Vector3d(-0.06, 0.02, 1.0).normalized();

SpotScene scene_of(int num_photos, double bow_m = 0.0) {
  const auto scene =
      draw_spot_scene(*example_camera("brown", 320, 240), board, beam_origin_in_cam, beam_direction_in_cam,
                      {.num_photos = num_photos, .min_range_m = 0.6, .max_range_m = 2.0, .bow_m = bow_m}, 3);
  if (!scene) throw std::runtime_error("no scene");
  return *scene;
}

SpotPhotoConfig spots_without_noise() {
  SpotPhotoConfig config;
  config.render.noise = 0.0;
  return config;
}

/// So little ambient light that the spot does not saturate.
SpotPhotoConfig dim_light() {
  SpotPhotoConfig config = spots_without_noise();
  config.render.black = 10.0;
  config.render.white = 60.0;
  return config;
}

/// A facing board at a distance, hit in the image's centre (160, 120), by a beam along the axis, at a position.
SpotScene centre_scene(double range_m, const Eigen::Vector3d& place) {
  const Camera camera{320, 240, Calibrated<Pinhole>{{400.0, 400.0, 160.0, 120.0, 0.0}}, {}, 0.0, ""};
  SpotScene scene{
      {camera, board, points_in_board(board), {}}, Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ(), {range_m}};
  scene.boards.cam_from_board.push_back({Eigen::Quaterniond::Identity(), range_m * Eigen::Vector3d::UnitZ() - place});
  return scene;
}

/// Centroid and sum of the red channel's light that the laser added.
struct AddedLight {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double sum = 0.0;
};
AddedLight added_light(const SpotScene& scene, std::size_t i, SpotPhotoConfig config) {
  const cv::Mat lit = render_spot_photo(scene, i, config, 1);
  config.is_on = false;
  const cv::Mat dark = render_spot_photo(scene, i, config, 1);
  AddedLight added;
  for (int v = 0; v < lit.rows; ++v) {
    for (int u = 0; u < lit.cols; ++u) {
      const double light = lit.at<cv::Vec3b>(v, u)[2] - dark.at<cv::Vec3b>(v, u)[2];
      added.sum += light;
      added.px += light * Eigen::Vector2d(u, v);
    }
  }
  added.px /= added.sum;
  return added;
}

TEST(SpotScene, TheBeamHitsThePrintOfEveryBoardAtItsRange) {
  for (const double bow_m : {0.0, 0.004}) {
    const SpotScene scene = scene_of(40, bow_m);
    ASSERT_EQ(scene.boards.cam_from_board.size(), 40u);
    const BoardSurface surface(board, scene.boards.points_in_board);
    const PrintedPattern pattern(board);
    for (std::size_t i = 0; i < 40; ++i) {
      EXPECT_TRUE(scene.range_m[i] >= 0.6 && scene.range_m[i] <= 2.0);
      const Eigen::Vector3d hit = scene.boards.cam_from_board[i].inverse() * spot_in_cam(scene, i);
      const Eigen::Vector3d from = scene.boards.cam_from_board[i].inverse() * beam_origin_in_cam;
      const auto place = surface.intersect(from, (hit - from).normalized(), hit.head<2>());
      ASSERT_TRUE(place);
      EXPECT_LT((surface.point(*place) - hit).norm(), 1e-8);
      EXPECT_TRUE((place->array() > pattern.print_min().array()).all());
      EXPECT_TRUE((place->array() < pattern.print_max().array()).all());
      for (const Eigen::Vector2d& px : true_corners(scene.boards, i)) EXPECT_TRUE(px.minCoeff() >= 6.0);
    }
  }
}

TEST(SpotScene, NoneWhereTheBeamLeavesTheImage) {
  const Camera camera = *example_camera("brown", 320, 240);
  EXPECT_FALSE(draw_spot_scene(camera, board, beam_origin_in_cam, Eigen::Vector3d(1.0, 0.0, 0.2), {}, 1));
  EXPECT_FALSE(draw_spot_scene(camera, board, beam_origin_in_cam, -beam_direction_in_cam, {}, 1));
}

TEST(SpotPhoto, WithTheLaserOffItIsTheGreyPhotoThreeTimes) {
  const SpotScene scene = scene_of(1);
  SpotPhotoConfig config = spots_without_noise();
  config.is_on = false;
  const cv::Mat dark = render_spot_photo(scene, 0, config, 1);
  const cv::Mat grey = render_board_photo(scene.boards, 0, config.render, 1);
  for (int channel = 0; channel < 3; ++channel) {
    cv::Mat one;
    cv::extractChannel(dark, one, channel);
    EXPECT_EQ(cv::countNonZero(one != grey), 0);
  }
}

TEST(BoardLight, AddedLightHasItsCentroidAtTheProjectedHit) {
  // Perspective over a spot of radius σ moves its centroid by about σ² tan(tilt) f/Z²: 0.004 px for 1.5 mm at 0.6 m.
  const SpotScene scene = scene_of(10);
  int checked = 0;
  for (std::size_t i = 0; i < 10; ++i) {
    const Rigid3 board_from_cam = scene.boards.cam_from_board[i].inverse();
    const Eigen::Vector3d hit_in_board = board_from_cam * spot_in_cam(scene, i);
    const Eigen::Vector3d direction_in_board = board_from_cam.rotation * scene.beam_direction_in_cam;
    const BoardLight board_light(scene.boards, i, RenderConfig{}, 1);
    const PixelLight light = board_light.added({0, 0, 320, 240}, 0.999999, [&](const Eigen::Vector3d& point_in_board) {
      return std::exp(-8.0 * (point_in_board - hit_in_board).cross(direction_in_board).squaredNorm() / (0.006 * 0.006));
    });
    const Eigen::ArrayXd u = Eigen::ArrayXd::LinSpaced(320, 0.0, 319.0), v = Eigen::ArrayXd::LinSpaced(240, 0.0, 239.0);
    const Eigen::MatrixXd weight = light.cast<double>() / light.cast<double>().sum();
    const Eigen::Vector2d centroid(weight.colwise().sum().dot(u.matrix()), weight.rowwise().sum().dot(v.matrix()));
    const Eigen::Array2d place = hit_in_board.head<2>();
    if ((place < -0.03).any() || place.x() > 0.28 || place.y() > 0.18) continue;  // the spot leaves the paper
    EXPECT_LT((centroid - *true_spot(scene, i)).norm(), 0.008) << i;
    ++checked;
  }
  EXPECT_GE(checked, 4);
}

TEST(SpotPhoto, ASpotOnAnEdgeLeansToThePaper) {
  // Facing board, the beam along the axis onto the vertical edge between squares: with ink's albedo a against paper's 1
  // the centroid of a Gaussian cut in half lies √(2/π) σ (1 − a)/(1 + a) to the paper's side.
  const SpotScene scene = centre_scene(1.0, {2.0 * 0.05, 1.5 * 0.05, 0.0});
  SpotPhotoConfig config = spots_without_noise();
  config.render.blur_px = 0.0;
  config.laser = {.peak = 45.0, .diameter_m = 0.03, .divergence_rad = 0.0};
  const AddedLight added = added_light(scene, 0, config);
  const double sigma_px = 400.0 * 0.03 / 4.0, albedo = 40.0 / 210.0;
  EXPECT_NEAR(std::abs(added.px.x() - 160.0),
              std::sqrt(2.0 / std::numbers::pi) * sigma_px * (1 - albedo) / (1 + albedo), 0.03);
  EXPECT_NEAR(added.px.y(), 120.0, 0.02);
  // Its light: half of it on paper, half on ink; ∫ peak exp(−r²/2σ²) = 2π σ² peak. Rounding: 0.3 √600 / 2545.
  EXPECT_NEAR(added.sum, 0.5 * (1.0 + albedo) * 2.0 * std::numbers::pi * sigma_px * sigma_px * 45.0, 25.0);
}

TEST(SpotPhoto, PowerIsKeptWhenTheBeamWidens) {
  // Both beams are 12 mm wide at 1 m, where `peak` is stated; the light of one wide at the hit is as much as of the
  // other.
  const SpotScene scene = centre_scene(1.7, {0.025, 0.075, 0.0});
  SpotPhotoConfig config = dim_light();
  config.laser = {.peak = 150.0, .diameter_m = 0.012, .divergence_rad = 0.0};
  const double sum = added_light(scene, 0, config).sum;
  config.laser = {.peak = 150.0, .diameter_m = 0.006, .divergence_rad = 0.006};
  const double sigma_px = 400.0 * 0.012 / 4.0 / 1.7;  // 2π σ² peak, all of it on one paper square of 12 px
  EXPECT_NEAR(sum, 2.0 * std::numbers::pi * sigma_px * sigma_px * 150.0, 10.0);  // rounding: 0.3 √100
  EXPECT_NEAR(added_light(scene, 0, config).sum / sum, 1.0, 0.015);
}

TEST(SpotPhoto, TooMuchLightIsWhiteInTheCentreAndColouredAround) {
  const SpotScene scene = centre_scene(1.0, {0.025, 0.075, 0.0});
  for (const LaserColour colour : {LaserColour::red, LaserColour::green}) {
    SpotPhotoConfig config = dim_light();
    config.laser = {.colour = colour, .peak = 3000.0, .diameter_m = 0.012};
    const cv::Mat photo = render_spot_photo(scene, 0, config, 1);
    EXPECT_EQ(photo.at<cv::Vec3b>(120, 160), cv::Vec3b(255, 255, 255));
    const auto& halo = photo.at<cv::Vec3b>(120, 163);
    EXPECT_EQ(halo[colour == LaserColour::red ? 2 : 1], 255);
    EXPECT_LT(halo[0], 200);
  }
}

}  // namespace
}  // namespace alidade
