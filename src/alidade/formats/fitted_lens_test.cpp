#include <gtest/gtest.h>

#include "alidade/formats/camera_file.h"

// Formats that hold less than a lens.

namespace alidade {
namespace {

// Where the other terms stayed as they were, this k3 was 74 px off in the corners. The least of all is numpy's, by
// lstsq with numerical derivatives over the same grid.
TEST(CameraFile, TheNearestLensWithoutWhatAFormatCannotHold) {
  Camera camera{1280, 960, Calibrated<Brown>{Params<Brown>{900, 905, 641, 478, 0, -0.28, 0.12, 3e-4, -2e-4, -0.03}},
                {},   0.0, {}};
  const Camera back = parse_camera(camera_text(camera, CameraFormat::kalibr, true), "f");
  const FittedLens fitted = fitted_lens(camera, CameraFormat::kalibr);
  EXPECT_EQ(params(back.lens), params(fitted.camera.lens));
  EXPECT_EQ(params(back.lens)[9], 0.0);
  Camera dropped = camera;
  std::get<Calibrated<Brown>>(dropped.lens).params[9] = 0.0;
  double worst_px = 0.0, dropped_px = 0.0;
  for (double v = 0.0; v < 960.0; v += 959.0 / 29.0)
    for (double u = 0.0; u < 1280.0; u += 1279.0 / 39.0) {
      const Eigen::Vector3d ray = *unproject(camera, {u, v});
      worst_px = std::max(worst_px, (*project(back, ray) - Eigen::Vector2d(u, v)).norm());
      dropped_px = std::max(dropped_px, (*project(dropped, ray) - Eigen::Vector2d(u, v)).norm());
    }
  EXPECT_NEAR(fitted.max_px, worst_px, 1e-9);
  EXPECT_NEAR(dropped_px, 73.5329, 1e-3);
  EXPECT_NEAR(worst_px, 4.9167, 1e-3);
  EXPECT_NEAR(fitted.rms_px, 0.55449, 1e-4);
  EXPECT_NEAR(params(fitted.camera.lens)[5], -0.248348, 1e-5);
  EXPECT_EQ(fitted_lens(camera, CameraFormat::ros).max_px, 0.0);
  camera.lens = Calibrated<Pinhole>{{900, 905, 641, 478, 0.5}};
  EXPECT_NEAR(fitted_lens(camera, CameraFormat::ros).max_px, 0.25, 0.1) << "the skew over half the height";
}

}  // namespace
}  // namespace alidade
