#include "alidade/simulate/boards/board_photos.h"

#include <gtest/gtest.h>

#include <opencv2/aruco/charuco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "alidade/simulate/boards/board_surface.h"
#include "alidade/simulate/boards/ray_table.h"
#include "alidade/simulate/draws.h"

namespace alidade {
namespace {

Camera wide_brown() {
  return {800, 600, Calibrated<Brown>{{620.0, 625.0, 405.0, 295.0, 0.0, -0.28, 0.09, 0.0005, -0.0004, -0.01}},
          {},  0.0, ""};
}
Camera plain_pinhole() { return {800, 600, Calibrated<Pinhole>{{700.0, 700.0, 399.5, 299.5, 0.0}}, {}, 0.0, ""}; }
Camera fisheye() {
  return {800, 600, Calibrated<KannalaBrandt>{{300.0, 300.0, 401.0, 298.0, 0.0, 0.02, -0.006, 0.001, 0.0}},
          {},  0.0, ""};
}

BoardScene facing_scene(const Camera& camera, const Board& board, double distance_m) {
  BoardScene scene{camera, board, points_in_board(board), {}};
  const Eigen::Vector3d middle = 0.5 * (scene.points_in_board.front() + scene.points_in_board.back());
  scene.cam_from_board.push_back({Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.0, 0.0, distance_m) - middle});
  return scene;
}

RenderConfig without_noise() {
  RenderConfig config;
  config.noise = 0.0;
  return config;
}

TEST(RayTable, InterpolatedRaysReturnToTheirPixel) {
  for (const Camera& camera : {wide_brown(), plain_pinhole(), fisheye()}) {
    const RayTable rays(camera, -5, 804, -5, 604);
    int checked = 0;
    double worst_px = 0.0;
    for (int v = -5; v <= 604; v += 3) {
      for (int u = -5; u <= 804; u += 3, ++checked) {
        const auto px = project(camera, rays.ray(u, v));
        ASSERT_TRUE(px);
        worst_px = std::max(worst_px, (*px - Eigen::Vector2d(u, v)).norm());
      }
    }
    EXPECT_EQ(checked, 270 * 204);
    EXPECT_LT(worst_px, 1e-4) << model_name(camera.lens);
  }
}

TEST(BoardScene, ShowsEveryPointWithinItsTilt) {
  for (const BoardKind kind : {BoardKind::chessboard, BoardKind::asymmetric_circles}) {
    const Board board{kind, 9, 6, 0.025, 0.0, ""};
    const BoardScene scene = draw_board_scene(wide_brown(), board, {.num_photos = 50, .max_tilt_rad = 0.7}, 3);
    ASSERT_EQ(scene.cam_from_board.size(), 50u);
    for (std::size_t i = 0; i < 50; ++i) {
      for (const Eigen::Vector2d& px : true_corners(scene, i)) {
        ASSERT_TRUE(px.allFinite());
        EXPECT_TRUE(px.x() >= 6 && px.y() >= 6 && px.x() <= 793 && px.y() <= 593) << px.transpose();
      }
      const Eigen::Vector3d normal = scene.cam_from_board[i].rotation * Eigen::Vector3d::UnitZ();
      EXPECT_LE(std::acos(std::min(1.0, normal.z())), 0.7 + 1e-9);
    }
  }
}

/// Mean over the corners of the image of how far the nearest of eight photos' points is. [px]
double unseen_px(bool into_corners, std::uint64_t seed) {
  const BoardSceneConfig config{.num_photos = 8, .into_corners = into_corners};
  const BoardScene scene = draw_board_scene(wide_brown(), Board{}, config, seed);
  double sum = 0.0;
  for (const Eigen::Vector2d& corner :
       {Eigen::Vector2d(0, 0), Eigen::Vector2d(799, 0), Eigen::Vector2d(0, 599), Eigen::Vector2d(799, 599)}) {
    double nearest = 1e9;
    for (std::size_t i = 0; i < 8; ++i) {
      for (const Eigen::Vector2d& px : true_corners(scene, i)) nearest = std::min(nearest, (px - corner).norm());
    }
    sum += nearest / 4.0;
  }
  return sum;
}

TEST(BoardScene, IsHeldIntoEachCornerOfTheImage) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    EXPECT_LT(unseen_px(true, seed), 0.8 * unseen_px(false, seed)) << seed;
  }
}

TEST(BoardScene, SameSeedSameSceneAnotherSeedAnother) {
  const auto translation = [](std::uint64_t seed) {
    return draw_board_scene(wide_brown(), Board{}, {.num_photos = 3}, seed).cam_from_board[2].translation;
  };
  EXPECT_EQ(translation(5), translation(5));
  EXPECT_NE(translation(5), translation(6));
}

TEST(SimulateViews, NoiseHasTheStatedCovariance) {
  const BoardScene scene = draw_board_scene(wide_brown(), Board{}, {.num_photos = 40}, 1);
  double chi2 = 0.0;
  int num_corners = 0;
  const std::vector<BoardView> views = simulate_views(scene, 0.1, 2);
  for (std::size_t i = 0; i < views.size(); ++i) {
    const std::vector<Eigen::Vector2d> truth = true_corners(scene, i);
    for (const Corner& corner : views[i].corners) {
      const Eigen::Vector2d error = corner.px - truth[static_cast<std::size_t>(corner.index)];
      chi2 += error.dot(corner.cov.inverse() * error);
      ++num_corners;
    }
  }
  EXPECT_EQ(num_corners, 40 * 54);
  EXPECT_NEAR(chi2, 2.0 * num_corners, 5.0 * std::sqrt(4.0 * num_corners));  // five sigmas of χ²
}

TEST(BoardSurface, PassesThroughThePointsAndMeetsItsRays) {
  const Board board{BoardKind::asymmetric_circles, 4, 11, 0.02, 0.0, ""};
  const BoardScene scene =
      draw_board_scene(plain_pinhole(), board, {.num_photos = 1, .bow_m = 0.003, .shape_sigma_m = 0.0005}, 4);
  const BoardSurface surface(board, scene.points_in_board);
  ASSERT_FALSE(surface.is_flat());
  const std::vector<Eigen::Vector3d> nominal = points_in_board(board);
  const Eigen::Vector3d eye(0.05, 0.1, -0.5);
  for (std::size_t i = 0; i < nominal.size(); ++i) {
    EXPECT_LT((surface.point(nominal[i].head<2>()) - scene.points_in_board[i]).norm(), 1e-12);
    const Eigen::Vector3d ray = (scene.points_in_board[i] - eye).normalized();
    const auto place = surface.intersect(eye, ray, nominal[i].head<2>() + Eigen::Vector2d(0.001, -0.001));
    ASSERT_TRUE(place);
    EXPECT_LT((*place - nominal[i].head<2>()).norm(), 1e-9);
  }
}

/// A board whose corners follow parabolas follows them between corners and in its margin as well: a corner's edges
/// would be off otherwise, and every camera from its photos.
TEST(BoardSurface, OfABowIsTheParabola) {
  for (const Board& board : {Board{BoardKind::chessboard, 9, 6, 0.025}, Board{BoardKind::chessboard, 3, 3, 0.025},
                             Board{BoardKind::asymmetric_circles, 4, 11, 0.02, 0.0, ""}}) {
    const std::vector<Eigen::Vector3d> nominal = points_in_board(board);
    const auto bent = [](double s, double t) {
      return Eigen::Vector3d(s + 1e-3 * s, t - 2e-3 * s, 0.3 * s * s - 0.02 * s + 0.5 * t * t + 0.001);
    };
    std::vector<Eigen::Vector3d> points;
    for (const Eigen::Vector3d& point : nominal) points.push_back(bent(point.x(), point.y()));
    const BoardSurface surface(board, points);
    const double margin = board.square_m, right = nominal.back().x(), bottom = nominal.back().y();
    for (double s = -margin; s < right + margin; s += 0.3 * board.square_m) {
      for (double t = -margin; t < bottom + margin; t += 0.3 * board.square_m) {
        EXPECT_LT((surface.point({s, t}) - bent(s, t)).norm(), 1e-12) << s << " " << t;
      }
    }
  }
}

/// Where an image's row crosses a near-vertical edge, from the sum of its grey values between two pixels: blur that is
/// symmetric does not move it.
double crossing(const cv::Mat& photo, int v, int u_from, int u_to) {
  double sum = 0.0;
  const double left = photo.at<unsigned char>(v, u_from), right = photo.at<unsigned char>(v, u_to);
  for (int u = u_from; u <= u_to; ++u) sum += photo.at<unsigned char>(v, u);
  return u_from - 0.5 + (sum - right * (u_to - u_from + 1)) / (left - right);
}

/// Mean and RMS of rendered minus true crossings of the edges between squares, over all squares of a photo.
struct EdgeErrors {
  int count = 0;
  double sum = 0.0, sum_squares = 0.0;
  [[nodiscard]] double mean() const { return sum / count; }
  [[nodiscard]] double rms() const { return std::sqrt(sum_squares / count); }
};

EdgeErrors edge_errors(const BoardScene& scene, const RenderConfig& config) {
  EdgeErrors errors;
  const BoardSurface surface(scene.board, scene.points_in_board);
  for (std::size_t i = 0; i < scene.cam_from_board.size(); ++i) {
    const cv::Mat photo = render_board_photo(scene, i, config, 1);
    for (int row = 0; row + 1 < scene.board.rows; ++row) {
      for (int col = 0; col < scene.board.cols; ++col) {
        const auto edge = [&](double share) {
          const Eigen::Vector2d place(col * scene.board.square_m, (row + share) * scene.board.square_m);
          return *project(scene.camera, scene.cam_from_board[i] * surface.point(place));
        };
        double share = 0.5;  // of the way along the edge: where it crosses the row of pixels nearest to its centre
        const int v = static_cast<int>(std::lround(edge(0.5).y()));
        for (int k = 0; k < 20; ++k) share += (v - edge(share).y()) / (edge(share + 0.01).y() - edge(share).y()) * 0.01;
        const double u = edge(share).x();
        const int reach = 7, middle = static_cast<int>(std::lround(u));
        const double error = crossing(photo, v, middle - reach, middle + reach) - u;
        errors.sum += error;
        errors.sum_squares += error * error;
        ++errors.count;
      }
    }
  }
  return errors;
}

TEST(RenderBoardPhoto, EdgesStandWhereTheLensPutsThem) {
  // Rounding to whole grey values alone scatters a crossing by about 0.29 √15 / 170 = 0.007 px; the mean shows a bias.
  const BoardSceneConfig flat{.num_photos = 6, .max_tilt_rad = 0.7, .min_fill = 0.75, .max_fill = 0.95};
  BoardSceneConfig bent = flat;
  bent.bow_m = 0.004;
  bent.shape_sigma_m = 0.0001;
  for (const BoardSceneConfig& config : {flat, bent}) {
    const BoardScene scene = draw_board_scene(wide_brown(), Board{}, config, 9);
    const EdgeErrors errors = edge_errors(scene, without_noise());
    EXPECT_EQ(errors.count, 6 * 9 * 5);
    EXPECT_LT(std::abs(errors.mean()), 0.0015);  // 0.007/√270 = 0.0004, times 3.5
    EXPECT_LT(errors.rms(), 0.0085);
  }
}

TEST(RenderBoardPhoto, MoreSubsamplesChangeNothing) {
  const BoardScene scene = draw_board_scene(wide_brown(), Board{}, {.num_photos = 2, .max_tilt_rad = 1.0}, 2);
  for (std::size_t i = 0; i < 2; ++i) {
    RenderConfig fine = without_noise();
    fine.oversampling = 12;
    cv::Mat difference;
    cv::absdiff(render_board_photo(scene, i, without_noise(), 1), render_board_photo(scene, i, fine, 1), difference);
    double most = 0.0;
    cv::minMaxLoc(difference, nullptr, &most);
    EXPECT_LE(most, 1.0);  // of 255, where the light is near a half
    EXPECT_LT(cv::countNonZero(difference), 0.02 * 800 * 600);
  }
}

TEST(RenderBoardPhoto, FacingCirclesHaveTheirCentroidAtTheCentre) {
  for (const BoardKind kind : {BoardKind::circles, BoardKind::asymmetric_circles}) {
    const Board board{kind, 5, 5, 0.02, 0.012, ""};
    const BoardScene scene = facing_scene(plain_pinhole(), board, 0.3011);
    const cv::Mat photo = render_board_photo(scene, 0, without_noise(), 1);
    const int reach = 20;
    int checked = 0;
    for (const Eigen::Vector2d& truth : true_corners(scene, 0)) {
      double weight = 0.0;
      Eigen::Vector2d sum(0.0, 0.0);
      const int u0 = static_cast<int>(std::lround(truth.x())), v0 = static_cast<int>(std::lround(truth.y()));
      for (int v = v0 - reach; v <= v0 + reach; ++v) {
        for (int u = u0 - reach; u <= u0 + reach; ++u) {
          const double ink = 210.0 - photo.at<unsigned char>(v, u);
          weight += ink;
          sum += ink * Eigen::Vector2d(u, v);
        }
      }
      EXPECT_LT((sum / weight - truth).norm(), 0.003);  // rounding of 1681 pixels: about 0.001
      ++checked;
    }
    EXPECT_EQ(checked, 25);
  }
}

TEST(RenderBoardPhoto, NoiseIsAsAskedAndFollowsTheSeed) {
  const BoardScene scene = facing_scene(plain_pinhole(), Board{}, 2.0);
  RenderConfig config;
  config.noise = 6.0;
  config.background_texture = 0.0;
  const cv::Mat photo = render_board_photo(scene, 0, config, 1);
  cv::Scalar mean, sigma;
  cv::meanStdDev(photo(cv::Rect(0, 0, 800, 100)), mean, sigma);
  EXPECT_NEAR(sigma[0], std::sqrt(36.0 + 1.0 / 12.0), 0.1);  // 6/√(2·80000) = 0.015, and rounding
  EXPECT_EQ(cv::countNonZero(photo != render_board_photo(scene, 0, config, 1)), 0);
  EXPECT_GT(cv::countNonZero(photo != render_board_photo(scene, 0, config, 2)), 1000);
}

TEST(RenderBoardPhoto, OpenCvFindsTheChessboardWhereItIs) {
  const BoardScene scene = draw_board_scene(wide_brown(), Board{}, {.num_photos = 4, .max_tilt_rad = 0.4}, 7);
  for (std::size_t i = 0; i < 4; ++i) {
    const cv::Mat photo = render_board_photo(scene, i, RenderConfig{}, 1);
    std::vector<cv::Point2f> found;
    ASSERT_TRUE(cv::findChessboardCorners(photo, cv::Size(9, 6), found));
    cv::cornerSubPix(photo, found, cv::Size(4, 4), cv::Size(-1, -1), {cv::TermCriteria::EPS, 0, 1e-3});
    const std::vector<Eigen::Vector2d> truth = true_corners(scene, i);
    const bool turned = std::hypot(found[0].x - truth[0].x(), found[0].y - truth[0].y()) > 5.0;
    for (std::size_t k = 0; k < truth.size(); ++k) {
      const cv::Point2f& px = found[turned ? truth.size() - 1 - k : k];
      EXPECT_LT(std::hypot(px.x - truth[k].x(), px.y - truth[k].y()), 0.3);
    }
  }
}

TEST(RenderBoardPhoto, OpenCvReadsTheMarkersOfItsOwnCharucoLayout) {
  const Board board{BoardKind::charuco, 6, 4, 0.03, 0.022, "DICT_5X5_100"};
  const BoardScene scene = draw_board_scene(plain_pinhole(), board, {.num_photos = 2, .min_fill = 0.8}, 11);
  const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_5X5_100);
  const auto layout = cv::aruco::CharucoBoard::create(7, 5, 0.03F, 0.022F, dictionary);
  for (std::size_t i = 0; i < 2; ++i) {
    std::vector<std::vector<cv::Point2f>> corners;
    std::vector<int> ids;
    cv::aruco::detectMarkers(render_board_photo(scene, i, RenderConfig{}, 1), dictionary, corners, ids);
    ASSERT_EQ(ids.size(), 17u);
    for (std::size_t k = 0; k < ids.size(); ++k) {
      Eigen::Vector2d error(0.0, 0.0);  // of the centre: each corner of a contour stands outside by about a pixel
      for (std::size_t c = 0; c < 4; ++c) {
        const cv::Point3f& point = layout->objPoints[static_cast<std::size_t>(ids[k])][c];
        const Eigen::Vector3d in_board(point.x - 0.03, point.y - 0.03, 0.0);
        const Eigen::Vector2d px = *project(scene.camera, scene.cam_from_board[i] * in_board);
        error += 0.25 * (Eigen::Vector2d(corners[k][c].x, corners[k][c].y) - px);
      }
      EXPECT_LT(error.norm(), 0.75) << ids[k];
    }
  }
}

}  // namespace
}  // namespace alidade
