#include "alidade/simulate/films/panorama_video.h"

#include <gtest/gtest.h>

#include <array>
#include <functional>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <tuple>

#include "alidade/pantilt/head_rotation.h"
#include "alidade/simulate/rotating_lens.h"

namespace alidade {
namespace {

constexpr int width = 320, height = 240;
const RotatingIntrinsics camera{300.0, 290.0, 163.0, 117.0, 0.0};

double spot_at(double u, double v) { return 230.0 * std::exp(-(u * u + v * v) / 4.5); }

/// A black photo with round spots of σ = 1.5 px.
cv::Mat photo_of_spots(const std::vector<cv::Point>& spots) {
  cv::Mat photo(201, 301, CV_8U, cv::Scalar(0));
  for (const cv::Point& spot : spots)
    for (int v = -8; v <= 8; ++v)
      for (int u = -8; u <= 8; ++u)
        photo.at<unsigned char>(spot.y + v, spot.x + u) = cv::saturate_cast<unsigned char>(spot_at(u, v));
  return photo;
}

/// Centroid of a spot's light in the image: perspective shifts it by 0.02 px.
Eigen::Vector2d expected_centroid(const cv::Point& spot,
                                  const std::function<Eigen::Vector2d(const Eigen::Vector2d&)>& px_of) {
  constexpr double step = 0.25, h = 0.01;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (double v = -8.0; v <= 8.0; v += step) {
    for (double u = -8.0; u <= 8.0; u += step) {
      const Eigen::Vector2d at(spot.x + u, spot.y + v), px = px_of(at);
      Eigen::Matrix2d area;
      area << px_of(at + h * Eigen::Vector2d::UnitX()) - px, px_of(at + h * Eigen::Vector2d::UnitY()) - px;
      sum += spot_at(u, v) * area.determinant() * px.homogeneous();
    }
  }
  return sum.hnormalized();
}

Eigen::Vector2d centroid(const cv::Mat& frame, const Eigen::Vector2d& around) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  const Eigen::Vector2i centre = around.array().round().cast<int>();
  for (int v = centre.y() - 9; v <= centre.y() + 9; ++v)
    for (int u = centre.x() - 9; u <= centre.x() + 9; ++u)
      sum += frame.at<unsigned char>(v, u) * Eigen::Vector3d(u, v, 1.0);
  return sum.head<2>() / sum.z();
}

/// Where `to` lies against `from`: the shift that explains their difference best. [px]
Eigen::Vector2d shift_between(const cv::Mat& from, const cv::Mat& to, const cv::Rect& where) {
  cv::Mat f, t;
  from(where).convertTo(f, CV_64F);
  to(where).convertTo(t, CV_64F);
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  for (int v = 1; v + 1 < f.rows; ++v) {
    for (int u = 1; u + 1 < f.cols; ++u) {
      const Eigen::Vector2d slope(0.5 * (f.at<double>(v, u + 1) - f.at<double>(v, u - 1)),
                                  0.5 * (f.at<double>(v + 1, u) - f.at<double>(v - 1, u)));
      normal += slope * slope.transpose();
      right += slope * (f.at<double>(v, u) - t.at<double>(v, u));
    }
  }
  return normal.inverse() * right;
}

TEST(Panorama, PutsSpotsWhereTheLensDoes) {
  const std::vector<cv::Point> spots = {{150, 100}, {100, 60}, {215, 80}, {90, 150}, {200, 145}};
  constexpr double rad_per_px = 1.0 / 280.0;
  FarWorld world = FarWorld::of_photo(photo_of_spots(spots), rad_per_px);
  using Bends = std::array<double, 5>;
  for (const auto& [k1, k2, k3, p1, p2] : {Bends{}, Bends{-0.2}, Bends{0.0, -0.3}, Bends{0.0, 0.0, 0.0, 0.02, -0.015},
                                           Bends{-0.2, 0.05, -0.01, -0.01, 0.02}}) {
    RotatingIntrinsics lens = camera;
    std::tie(lens.k1, lens.k2, lens.k3, lens.p1, lens.p2) = std::tie(k1, k2, k3, p1, p2);
    // Rounding to whole grey values scatters a centroid by 0.004 px: the mean of 4 poses. 0.003 px are the photo's own
    // interpolation, which makes the spots wider and lean more.
    std::vector<Eigen::Vector2d> mean(spots.size(), Eigen::Vector2d::Zero());
    for (int pose = 0; pose < 4; ++pose) {
      const Eigen::Quaterniond base_from_cam =
          base_from_cam_rotation({0.07 + 0.0011 * pose, -0.05 + 0.0007 * pose, 0.2 - 0.1 * pose});
      const cv::Mat frame = render_panorama(world, lens, width, height, base_from_cam, {.noise = 0.0}, 1);
      for (std::size_t i = 0; i < spots.size(); ++i) {
        const Eigen::Vector2d expected = expected_centroid(spots[i], [&](const Eigen::Vector2d& px) {
          const double a = (px.x() - 150.0) * rad_per_px, b = std::atan(std::sinh((px.y() - 100.0) * rad_per_px));
          const Eigen::Vector3d point_in_base(std::cos(b) * std::sin(a), std::sin(b), std::cos(b) * std::cos(a));
          const Eigen::Vector3d point_in_cam = base_from_cam.conjugate() * point_in_base;
          return px_of_ray(lens, point_in_cam.head<2>() / point_in_cam.z());
        });
        const Eigen::Vector2d error = centroid(frame, expected) - expected;
        EXPECT_LT(error.norm(), 0.02);
        mean[i] += error / 4.0;
      }
    }
    for (const Eigen::Vector2d& each : mean)
      EXPECT_LT(each.norm(), 0.01) << each.transpose() << " k1 " << k1 << " k2 " << k2 << " p1 " << p1;
  }
}

/// p(t) ~ K R K⁻¹ p(0), with OpenCV's warp: nothing of the renderer's geometry is used.
TEST(Panorama, FramesAreOneWorldSeenThroughKRK) {
  FarWorld world = FarWorld::of_noise(3.0 / 300.0, 5);
  const Eigen::Vector3d here(0.3, 0.4, 0.0), there(0.34, 0.37, 0.03);
  const cv::Mat a = render_panorama(world, camera, width, height, base_from_cam_rotation(here), {.noise = 0.0}, 1);
  const cv::Mat b = render_panorama(world, camera, width, height, base_from_cam_rotation(there), {.noise = 0.0}, 1);
  Eigen::Matrix3d k;
  k << camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0;
  const Eigen::Quaterniond a_from_b = base_from_cam_rotation(here).conjugate() * base_from_cam_rotation(there);
  const Eigen::Matrix3d h = k * a_from_b.toRotationMatrix() * k.inverse();
  cv::Mat map(height, width, CV_32FC2), warped;
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      const Eigen::Vector3d p = h * Eigen::Vector3d(u, v, 1.0);
      map.at<cv::Vec2f>(v, u) = {static_cast<float>(p.x() / p.z()), static_cast<float>(p.y() / p.z())};
    }
  cv::remap(a, warped, map, cv::noArray(), cv::INTER_LANCZOS4);
  for (const int u : {60, 170})
    for (const int v : {40, 120}) EXPECT_LT(shift_between(warped, b, {u, v, 90, 80}).norm(), 0.01) << u << ", " << v;
}

TEST(Panorama, FinerSubsamplesMoveNothing) {
  FarWorld world = FarWorld::of_noise(3.0 / 300.0, 6);
  const Eigen::Quaterniond base_from_cam = base_from_cam_rotation({-0.9, 0.3, 0.0});
  const cv::Mat two = render_panorama(world, camera, width, height, base_from_cam, {.noise = 0.0}, 1);
  const cv::Mat six =
      render_panorama(world, camera, width, height, base_from_cam, {.noise = 0.0, .oversampling = 6}, 1);
  EXPECT_LT(shift_between(two, six, {4, 4, width - 8, height - 8}).norm(), 0.002);
  // What is left are the roundings of both, and half a grey value of the texture's finest edges.
  EXPECT_LT(cv::norm(two, six, cv::NORM_L2) / std::sqrt(width * height), 1.0);
}

TEST(Panorama, NoiseIsSeededAndOfItsSigma) {
  FarWorld world = FarWorld::of_noise(3.0 / 300.0, 7);
  const auto render = [&](double noise, std::uint64_t seed) {
    cv::Mat frame =
        render_panorama(world, camera, width, height, base_from_cam_rotation({0.0, 0.0, 0.0}), {.noise = noise}, seed);
    return frame;
  };
  EXPECT_EQ(cv::norm(render(2.0, 3), render(2.0, 3), cv::NORM_INF), 0.0);
  cv::Mat difference;
  cv::subtract(render(2.0, 3), render(2.0, 4), difference, cv::noArray(), CV_64F);
  cv::Scalar mean, sigma;
  cv::meanStdDev(difference, mean, sigma);
  EXPECT_NEAR(sigma[0], std::sqrt(2.0 * (2.0 * 2.0 + 1.0 / 12.0)), 0.05);  // 76 800 pixels: ± 0.008
}

/// A steady pan with some tilt.
RotationScene panning_scene() {
  RotationScene scene;
  scene.width_px = width, scene.height_px = height;
  scene.intrinsics = [](double) { return camera; };
  scene.motion = [](double t_s) { return Eigen::Vector3d(0.5 * t_s, 0.1 * t_s, 0.0); };
  return scene;
}

/// Each row of a rolling shutter is what a global one sees at that row's time.
TEST(PanoramaFrame, RowsOfARollingShutterAreOfTheirTimes) {
  FarWorld world = FarWorld::of_noise(3.0 / 300.0, 8);
  RotationScene scene = panning_scene();
  const auto frame = [&](double shutter_s, double delay_s) {
    scene.shutter_s = shutter_s, scene.delay_s = delay_s;
    return render_panorama_frame(world, scene, 15, 30.0, {.noise = 0.0}, 1);
  };
  const cv::Mat rolling = frame(0.06, 0.0);
  for (const int v : {20, 110, 200}) {
    const cv::Rect strip(20, v, width - 40, 20);
    const double late_s = 0.06 * (v + 9.5 - 0.5 * (height - 1)) / height;
    EXPECT_LT(shift_between(frame(0.0, late_s), rolling, strip).norm(), 0.03) << v;
    if (v != 110)
      EXPECT_GT(shift_between(frame(0.0, 0.0), rolling, strip).norm(), 0.5) << v;  // 3 px; beyond its slopes
  }
}

/// A camera's clock that is fast by two in a hundred is 10 ms ahead after half a second.
TEST(PanoramaFrame, AFastClockIsADelayThatGrows) {
  FarWorld world = FarWorld::of_noise(3.0 / 300.0, 9);
  RotationScene scene = panning_scene();
  const auto frame = [&](double clock_rate, double delay_s) {
    scene.clock_rate = clock_rate, scene.delay_s = delay_s;
    return render_panorama_frame(world, scene, 15, 30.0, {.noise = 0.0}, 1);
  };
  EXPECT_LT(cv::norm(frame(0.02, 0.0), frame(0.0, 0.01), cv::NORM_INF), 2.0);
  EXPECT_GT(shift_between(frame(0.0, 0.0), frame(0.02, 0.0), {20, 20, width - 40, height - 40}).norm(), 0.5);
}

/// Of a camera at rest, what differs after two seconds is on things that move.
TEST(PanoramaFrame, AShareOfTheImageMoves) {
  RotationScene scene;
  scene.width_px = width, scene.height_px = height;
  scene.intrinsics = [](double) { return camera; };
  scene.motion = [](double) { return Eigen::Vector3d(0.2, 0.1, 0.0); };
  double share = 0.0;
  constexpr int worlds = 8;
  for (std::uint64_t seed = 1; seed <= worlds; ++seed) {
    FarWorld world = FarWorld::of_noise(3.0 / 300.0, seed);
    const PanoramaConfig moving{.noise = 0.0, .moving_share = 0.25}, still{.noise = 0.0};
    const cv::Mat first = render_panorama_frame(world, scene, 0, 30.0, moving, seed);
    EXPECT_EQ(cv::norm(first, render_panorama_frame(world, scene, 0, 30.0, still, seed), cv::NORM_INF), 0.0);
    cv::Mat differs;
    cv::absdiff(first, render_panorama_frame(world, scene, 60, 30.0, moving, seed), differs);
    share += cv::countNonZero(differs > 1) / static_cast<double>(worlds * width * height);
  }
  EXPECT_NEAR(share, 0.25, 0.1);  // some thirty discs, of which a tenth looks alike by chance, and what they uncover
}

/// The rates of the log rotate the camera as the frames say, off-axis mount and all.
TEST(PanoramaLog, RatesAreThoseOfTheHead) {
  RotationScene scene;
  scene.motion = [](double t_s) {
    return Eigen::Vector3d(paper_pan_tilt(t_s, 0.4) + Eigen::Vector3d(0, 0, 0.1 * t_s));
  };
  scene.mount_rad = {0.02, -0.01, 0.03};
  const RotationLog log = panorama_log(scene, {.source = RotationSource::rate, .duration_s = 2.0}, 1);
  const Eigen::Quaterniond cam_from_mount = exp_so3(scene.mount_rad);
  ASSERT_EQ(log.rows.size(), 61u);
  ASSERT_EQ(log.truth.size(), 61u);
  for (const RotationRow& row : log.rows) {
    constexpr double h = 1e-4;
    const Eigen::Quaterniond turn =
        true_base_from_cam(scene, row.t_s - h).conjugate() * true_base_from_cam(scene, row.t_s + h);
    const Eigen::Vector3d rate_in_cam = log_so3(turn) / (2.0 * h);
    EXPECT_LT((cam_from_mount * row.rate_rad_per_s - rate_in_cam).norm(), 1e-6);
  }
}

}  // namespace
}  // namespace alidade
