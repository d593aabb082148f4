#include "alidade/camera/kannala_brandt.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <opencv2/calib3d.hpp>

#include "alidade/testing/random.h"

namespace alidade {
namespace {

constexpr double pi = std::numbers::pi;

TEST(KannalaBrandt, ProjectsAsOpenCvDoes) {
  auto rng = testing::make_rng();
  std::uniform_real_distribution<> unit(-1.0, 1.0);
  int checked = 0;
  for (int lens = 0; lens < 50; ++lens) {
    const Params<KannalaBrandt> params{400.0 + 100.0 * unit(rng),
                                       400.0 + 100.0 * unit(rng),
                                       640.0,
                                       480.0,
                                       2.0 * unit(rng),
                                       0.05 * unit(rng),
                                       0.02 * unit(rng),
                                       0.01 * unit(rng),
                                       0.005 * unit(rng)};
    const cv::Matx33d K(params[0], 0, params[2], 0, params[1], params[3], 0, 0, 1);
    const cv::Vec4d k(params[5], params[6], params[7], params[8]);
    std::vector<cv::Point3d> points;
    for (int i = 0; i < 200; ++i) points.emplace_back(unit(rng), unit(rng), 1.1 + unit(rng));  // OpenCV needs Z > 0
    std::vector<cv::Point2d> reference;
    cv::fisheye::projectPoints(points, reference, cv::Vec3d(), cv::Vec3d(), K, k, params[4] / params[0]);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto px = KannalaBrandt::project(params, {points[i].x, points[i].y, points[i].z});
      if (!px) continue;  // beyond the fold, where OpenCV answers all the same
      EXPECT_NEAR(px->x(), reference[i].x, 1e-9);
      EXPECT_NEAR(px->y(), reference[i].y, 1e-9);
      ++checked;
    }
  }
  EXPECT_GT(checked, 9000);
}

TEST(KannalaBrandt, EquidistantSeesUpToStraightBehind) {
  const Params<KannalaBrandt> params{100.0, 100.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
  EXPECT_EQ(KannalaBrandt::max_angle(params), pi);
  for (const double theta : {1e-200, 1e-9, 0.5 * pi, 3.0, pi - 1e-6}) {
    const auto px = KannalaBrandt::project(params, {std::sin(theta), 0.0, std::cos(theta)});
    ASSERT_TRUE(px) << theta;
    EXPECT_NEAR(px->x(), 100.0 * theta, 1e-12 * (1.0 + 100.0 * theta));
    const auto ray = KannalaBrandt::unproject(params, *px);
    ASSERT_TRUE(ray);
    EXPECT_NEAR(std::atan2(ray->x(), ray->z()), theta, 1e-12);
  }
  EXPECT_FALSE(KannalaBrandt::unproject(params, {100.0 * pi + 1e-6, 0.0}));
}

TEST(KannalaBrandt, IsThePinholeOnTheAxis) {
  const Params<KannalaBrandt> params{300.0, 310.0, 640.0, 480.0, 1.5, -0.02, 0.004, -0.001, 1e-4};
  const auto at = KannalaBrandt::project_with_jacobians(params, {0.0, 0.0, 2.0});
  ASSERT_TRUE(at);
  EXPECT_EQ(at->px, Eigen::Vector2d(640.0, 480.0));
  EXPECT_EQ(at->J_px_point, (Eigen::Matrix<double, 2, 3>() << 150.0, 0.75, 0.0, 0.0, 155.0, 0.0).finished());
}

TEST(KannalaBrandt, IsOneToOneUpToItsFold) {
  auto rng = testing::make_rng();
  std::uniform_real_distribution<> unit(-1.0, 1.0);
  int folded = 0;
  for (int i = 0; i < 300; ++i) {
    const Params<KannalaBrandt> p{
        300.0, 300.0, 0.0, 0.0, 0.0, 0.2 * unit(rng), 0.05 * unit(rng), 0.02 * unit(rng), 0.01 * unit(rng)};
    const double max_angle = KannalaBrandt::max_angle(p);
    folded += max_angle < pi;
    double last = -1.0;
    for (int step = 0; step < 300; ++step) {
      const double theta = max_angle * step / 300.0;
      const auto px = KannalaBrandt::project(p, {std::sin(theta), 0.0, std::cos(theta)});
      ASSERT_TRUE(px);
      ASSERT_GT(px->x(), last);
      last = px->x();
    }
    if (max_angle < pi) {
      const double beyond = max_angle + 1e-6;
      EXPECT_FALSE(KannalaBrandt::project(p, {std::sin(beyond), 0.0, std::cos(beyond)}));
    }
  }
  EXPECT_GT(folded, 50);
}

}  // namespace
}  // namespace alidade
