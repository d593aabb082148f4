#include <gtest/gtest.h>

#include <cmath>

#include "alidade/geometry/so3.h"
#include "alidade/turned/turned_model.h"

namespace alidade {
namespace {

const TurnedCamera bent = (TurnedCamera() << 1.6, 1.58, 0.02, -0.03, -0.2, 0.05, 0.01, -0.02, 0.03, -0.01).finished();
const Eigen::Matrix3d turned = exp_so3({0.1, -0.2, 0.05}).toRotationMatrix();
const Eigen::Vector3d ray = Eigen::Vector3d(0.3, 0.1, 1.0).normalized();

Eigen::Vector2d px(const TurnedCamera& camera, const Eigen::Matrix3d& R, double zoom, const Eigen::Vector3d& to) {
  return turned_pixel(camera, R, zoom, to).value();
}

TEST(TurnedModel, DerivativesAreThoseOfTheFunction) {
  TurnedPrediction seen;
  constexpr double zoom = 0.1, h = 1e-6;
  ASSERT_TRUE(predict_turned(bent, turned, zoom, ray, seen));
  EXPECT_LT((seen.px - px(bent, turned, zoom, ray)).norm(), 1e-15);
  for (int i = 0; i < num_camera; ++i) {
    const TurnedCamera step = h * TurnedCamera::Unit(i);
    const Eigen::Vector2d slope = (px(bent + step, turned, zoom, ray) - px(bent - step, turned, zoom, ray)) / (2.0 * h);
    EXPECT_LT((slope - seen.J_camera.col(i)).norm(), 1e-8) << "camera " << i;
  }
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d step = h * Eigen::Vector3d::Unit(i);
    const Eigen::Matrix3d more = exp_so3(step).toRotationMatrix(), less = exp_so3(-step).toRotationMatrix();
    const Eigen::Vector2d by_turn =
        (px(bent, more * turned, zoom, ray) - px(bent, less * turned, zoom, ray)) / (2.0 * h);
    EXPECT_LT((by_turn - seen.J_photo.col(i)).norm(), 1e-8) << "turn " << i;
    const Eigen::Vector2d by_ray =
        (px(bent, turned, zoom, ray + step) - px(bent, turned, zoom, ray - step)) / (2.0 * h);
    EXPECT_LT((by_ray - seen.J_ray.col(i)).norm(), 1e-8) << "ray " << i;
  }
  const Eigen::Vector2d by_zoom = (px(bent, turned, zoom + h, ray) - px(bent, turned, zoom - h, ray)) / (2.0 * h);
  EXPECT_LT((by_zoom - seen.J_photo.col(3)).norm(), 1e-8);
}

TEST(TurnedModel, ARayIsWhatItsPixelSees) {
  for (const double x : {-0.9, -0.2, 0.0, 0.5, 1.0}) {
    const auto seen = turned_ray(bent, 0.1, {x, 0.4});
    ASSERT_TRUE(seen);
    EXPECT_LT((px(bent, Eigen::Matrix3d::Identity(), 0.1, *seen) - Eigen::Vector2d(x, 0.4)).norm(), 1e-12);
  }
}

TEST(TurnedModel, BehindTheCameraAndBeyondTheFoldThereIsNoPixel) {
  TurnedCamera folds = bent;
  folds[4] = -0.3;
  folds.tail<4>().setZero();
  folds[5] = 0.0;  // r (1 − 0.3 r²) falls from r = 1.05 on
  const Eigen::Matrix3d ahead = Eigen::Matrix3d::Identity();
  EXPECT_TRUE(turned_pixel(folds, ahead, 0.0, {1.0, 0.0, 1.0}));
  EXPECT_FALSE(turned_pixel(folds, ahead, 0.0, {1.1, 0.0, 1.0}));
  EXPECT_FALSE(turned_pixel(folds, ahead, 0.0, {0.0, 0.0, -1.0}));
  EXPECT_FALSE(turned_ray(folds, 0.0, {3.0, 0.0}));
}

}  // namespace
}  // namespace alidade
