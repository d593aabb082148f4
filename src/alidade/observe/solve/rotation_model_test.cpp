#include "alidade/observe/solve/rotation_model.h"

#include <gtest/gtest.h>

#include "alidade/geometry/so3.h"
#include "alidade/simulate/draws.h"
#include "alidade/testing/random.h"

namespace alidade {
namespace {

struct Sample {
  RotatingCamera camera;
  RotationFrame frame;
  BearingPoint point;
};

Sample draw_sample(Draws& draws) {
  Sample sample;
  sample.camera.k = {1.7 + 0.3 * draws.normal(), 1.7 + 0.3 * draws.normal(), 0.1 * draws.normal(),
                     0.1 * draws.normal()};
  sample.camera.k1 = 0.1 * draws.normal();
  sample.camera.k2 = 0.05 * draws.normal();
  sample.camera.k3 = 0.02 * draws.normal();
  sample.camera.p1 = 0.01 * draws.normal();
  sample.camera.p2 = 0.01 * draws.normal();
  sample.camera.cam_from_mount = exp_so3(0.1 * draws.normal3());
  sample.camera.delay_s = 0.02 * draws.normal();
  sample.camera.lever_m = 0.1 * draws.normal3();
  sample.frame.cam_from_start = exp_so3(0.2 * draws.normal3());
  sample.frame.rate_rad_per_s = draws.normal3();
  // About the same axis: about others the derivative by the delay is right to its square only.
  sample.frame.acceleration_rad_per_s2 = draws.normal() * sample.frame.rate_rad_per_s;
  sample.frame.shift_m = 0.2 * draws.normal3();
  sample.camera.shutter_s = 0.02 * draws.normal();
  sample.camera.image_height = 1.5;
  sample.camera.drift_per_s = 0.01 * draws.normal();
  sample.camera.drift_from_s = 2.0;
  sample.frame.t_s = 5.0;
  sample.frame.turn_by.resize(3, max_rotation_errors);
  sample.camera.errors.resize(max_rotation_errors);
  for (int i = 0; i < max_rotation_errors; ++i) {
    sample.frame.turn_by.col(i) = 0.02 * draws.normal3();
    sample.camera.errors[i] = draws.normal();
  }
  sample.point.start_from_point = rotation_to({0.2 * draws.normal(), 0.2 * draws.normal(), 1.0});
  sample.point.ab = 0.05 * draws.normal2();
  sample.point.inverse_depth = draws.uniform(0.0, 0.5);
  return sample;
}

constexpr ObserveNuisances everything{.k1 = true,
                                      .k2 = true,
                                      .k3 = true,
                                      .tangential = true,
                                      .mount = true,
                                      .delay = true,
                                      .lever = true,
                                      .shutter = true,
                                      .drift = true,
                                      .errors = max_rotation_errors,
                                      .learnt = true,
                                      .rotation = true};

/// The rotation's derivative is about none: it is the error that is left.
TEST(RotationModel, JacobiansAreTheDerivatives) {
  Draws draws(testing::make_rng()());
  const CommonLayout layout(everything);
  ASSERT_EQ(layout.size, max_common);
  int checked = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const Sample sample = draw_sample(draws);
    RotationPrediction predicted;
    if (!RotationView(sample.camera, sample.frame).predict(sample.point, layout, predicted)) continue;
    constexpr double h = 1e-6;
    for (int i = 0; i < layout.size; ++i) {
      CommonVector step = CommonVector::Zero(layout.size);
      step[i] = h;
      const RotatingCamera more = sample.camera.retract(layout, step), less = sample.camera.retract(layout, -step);
      const auto up = RotationView(more, sample.frame).project(sample.point);
      const auto down = RotationView(less, sample.frame).project(sample.point);
      ASSERT_TRUE(up && down);
      EXPECT_NEAR(((*up - *down) / (2.0 * h) - predicted.J_px_common.col(i)).norm(), 0.0, 1e-7) << "parameter " << i;
    }
    for (int i = 0; i < 3; ++i) {
      BearingPoint more = sample.point, less = sample.point;
      (i < 2 ? more.ab[i] : more.inverse_depth) += h;
      (i < 2 ? less.ab[i] : less.inverse_depth) -= h;
      const RotationView view(sample.camera, sample.frame);
      const auto up = view.project(more), down = view.project(less);
      ASSERT_TRUE(up && down);
      EXPECT_NEAR(((*up - *down) / (2.0 * h) - predicted.J_px_point.col(i)).norm(), 0.0, 1e-7) << "point " << i;
    }
    ++checked;
  }
  EXPECT_GT(checked, 150);
}

TEST(RotationModel, RayInStartUndoesTheProjectionOfAFarPoint) {
  Draws draws(testing::make_rng()());
  int checked = 0;
  for (int trial = 0; trial < 200; ++trial) {
    Sample sample = draw_sample(draws);
    sample.point.inverse_depth = 0.0;
    const RotationView view(sample.camera, sample.frame);
    const auto px = view.project(sample.point);
    if (!px) continue;
    const auto ray = view.ray_in_start(*px);
    ASSERT_TRUE(ray);
    EXPECT_NEAR(ray->cross(sample.point.ray().normalized()).norm(), 0.0, 1e-10);
    ++checked;
  }
  EXPECT_GT(checked, 150);
}

TEST(RotationModel, HasNoPixelBehindTheCameraOrBeyondTheFold) {
  RotatingCamera camera;
  camera.k1 = -0.3;
  BearingPoint point;
  const RotationView view(camera, RotationFrame{});
  point.ab = {1.2, 0.0};  // 1 − 0.9 · 1.44 < 0
  EXPECT_FALSE(view.project(point));
  point.ab = {0.0, 0.0};
  EXPECT_TRUE(view.project(point));
  point.start_from_point = rotation_to({0.0, 0.0, -1.0});
  EXPECT_FALSE(view.project(point));
}

}  // namespace
}  // namespace alidade
