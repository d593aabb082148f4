#include "alidade/simulate/films/underwater_video.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "alidade/board_detector/find_board.h"
#include "alidade/simulate/boards/board_photos.h"
#include "alidade/simulate/underwater.h"

namespace alidade {
namespace {

Camera pinhole_camera() {
  Camera camera;
  camera.width_px = 320;
  camera.height_px = 240;
  camera.lens = Calibrated<Pinhole>{Params<Pinhole>(300.0, 300.0, 159.5, 119.5, 0.0)};
  return camera;
}

/// Straight in front of a point of the board.
Rigid3 before(double x_m, double y_m, double distance_m) {
  return {Eigen::Quaterniond::Identity(), {x_m, y_m, -distance_m}};
}

UnderwaterVideoConfig silent() {
  UnderwaterVideoConfig config;
  config.noise = 0.0;
  return config;
}

/// Red, green, blue of a pixel.
Eigen::Vector3d rgb_at(const cv::Mat& frame, int u, int v) {
  const auto bgr = frame.at<cv::Vec3b>(v, u);
  return {static_cast<double>(bgr[2]), static_cast<double>(bgr[1]), static_cast<double>(bgr[0])};
}

/// Centre of a white and of a black square, seen straight on from there.
std::pair<Eigen::Vector3d, Eigen::Vector3d> white_and_black(double distance_m) {
  const double square_m = underwater_board().square_m, x = 0.5 * square_m, y = 0.5 * square_m;
  const cv::Mat one = render_underwater_frame(pinhole_camera(), before(x, y, distance_m), silent(), 1);
  const cv::Mat other = render_underwater_frame(pinhole_camera(), before(x + square_m, y, distance_m), silent(), 1);
  const Eigen::Vector3d a = rgb_at(one, 159, 119), b = rgb_at(other, 159, 119);
  return a.sum() > b.sum() ? std::pair{a, b} : std::pair{b, a};
}

TEST(UnderwaterVideo, ContrastFallsByTheLawOfBeerAndLambert) {
  const double near_m = 0.5, far_m = 1.0;
  const auto [white_near, black_near] = white_and_black(near_m);
  const auto [white_far, black_far] = white_and_black(far_m);
  const Eigen::Vector3d attenuation = Water{}.attenuation_per_m;
  for (int channel = 0; channel < 3; ++channel) {
    const double near = white_near[channel] - black_near[channel], far = white_far[channel] - black_far[channel];
    // Each grey value is rounded: half a value either way in both differences, at most.
    EXPECT_NEAR(far, near * std::exp(-attenuation[channel] * (far_m - near_m)), 2.0) << channel;
    EXPECT_GT(near - far, 10.0) << channel;
  }
  // Red at 1 m by hand: paper of 210, e^-1.2 = 0.301194, water of 22.
  EXPECT_NEAR(white_far[0], 210.0 * 0.301194 + 22.0 * 0.698806, 0.51);
  EXPECT_NEAR(black_far[0], 40.0 * 0.301194 + 22.0 * 0.698806, 0.51);
}

TEST(UnderwaterVideo, FarAwayThereIsWaterAlone) {
  const cv::Mat frame = render_underwater_frame(pinhole_camera(), before(0.1, 0.1, 60.0), silent(), 1);
  EXPECT_LT((rgb_at(frame, 160, 120) - Water{}.veil).cwiseAbs().maxCoeff(), 0.51);
}

/// Light goes along each pixel's own ray: on a slanted one there is more water.
TEST(UnderwaterVideo, TowardsTheEdgeThereIsMoreWater) {
  const cv::Mat frame = render_underwater_frame(pinhole_camera(), before(-2.0, -2.0, 0.6), silent(), 1);  // wall alone
  const double slant = std::hypot(1.0, 159.5 / 300.0, 119.5 / 300.0);  // distance over depth in the image's corner
  const Eigen::Vector3d centre = rgb_at(frame, 160, 120) - Water{}.veil, corner = rgb_at(frame, 0, 0) - Water{}.veil;
  for (int channel = 0; channel < 3; ++channel)
    EXPECT_NEAR(corner[channel], centre[channel] * std::exp(-Water{}.attenuation_per_m[channel] * 0.6 * (slant - 1.0)),
                1.1)
        << channel;
}

/// OpenCV says where the points are; what is found in the image is there within its σ.
TEST(UnderwaterVideo, CornersAreWhereOpenCVPutsThem) {
  const Camera camera = underwater_camera();
  const UnderwaterSequence sequence = simulate_underwater({.camera = camera}, 5);
  const cv::Matx33d K(768.0, 0.0, 389.0, 0.0, 766.0, 284.0, 0.0, 0.0, 1.0);
  const std::vector<double> distortion{-0.44881, 0.0664, 0.01316, 0.00218};
  double chi2 = 0.0, dof = 0.0;
  for (const std::size_t k : {0u, 12u, 24u}) {
    const Rigid3 cam_from_world = sequence.frames[k].world_from_cam.inverse();
    const cv::Mat frame =
        render_underwater_frame(camera, sequence.frames[k].world_from_cam, UnderwaterVideoConfig{}, 7 + k);
    const BoardDetection found = find_board(frame, underwater_board());
    ASSERT_TRUE(found.found()) << found.reason;
    for (const Corner& corner : found.view.corners) {
      const auto id = underwater_point_at(corner.index);
      if (!id) continue;
      const Eigen::Vector3d p = cam_from_world * sequence.points[static_cast<std::size_t>(*id) - 1].point_in_world;
      std::vector<cv::Point2d> px;
      cv::projectPoints(std::vector<cv::Point3d>{{p.x(), p.y(), p.z()}}, cv::Vec3d(), cv::Vec3d(), K, distortion, px);
      const Eigen::Vector2d error = corner.px - Eigen::Vector2d(px[0].x, px[0].y);
      chi2 += error.dot(corner.cov.inverse() * error);
      dof += 2.0;
    }
  }
  EXPECT_GE(dof, 2.0 * 20.0);                         // of 24 points
  EXPECT_LT(chi2, dof + 5.0 * std::sqrt(2.0 * dof));  // five sigmas of χ²
  EXPECT_GT(chi2, dof - 3.0 * std::sqrt(2.0 * dof));
}

TEST(UnderwaterVideo, PointsStandOnTheBoardsCorners) {
  const auto corners = points_in_board(underwater_board());
  const UnderwaterSequence sequence = simulate_underwater({.camera = underwater_camera()}, 1);
  int num = 0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const auto id = underwater_point_at(static_cast<int>(i));
    if (!id) continue;
    ++num;
    EXPECT_LT((sequence.points[static_cast<std::size_t>(*id) - 1].point_in_world - corners[i]).norm(), 1e-12) << *id;
  }
  EXPECT_EQ(num, 8);
}

}  // namespace
}  // namespace alidade
