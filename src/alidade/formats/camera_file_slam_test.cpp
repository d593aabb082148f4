#include <gtest/gtest.h>

#include <cmath>

#include "alidade/formats/camera_file.h"

// Camera files of others whose distortion is written the other way round, against their own formulas.

namespace alidade {
namespace {

constexpr const char* scenelib = R"(# to use the same images as SceneLib 1.0
input.mode = 0;
cam.width = 320;
cam.height = 240;
cam.fku = 195;
cam.fkv = 195;
cam.u0 = 162;
cam.v0 = 125;
cam.kd1 = 9e-06;
cam.sd = 1;
#cam.kd1 = 1e-12;
params.delta_t = 0.033333333;
state.rw_x = 0.0;
f1.identifier = ../../data/known_patch0.pgm;
)";

constexpr const char* civera = R"(function cam = initialize_cam()
d =     0.0112;
nRows = 240;
nCols = 320;
Cx =    1.7945 / d;   % of the sensor
Cy =    1.4433 / d;
k1=     6.333e-2;
k2=     1.390e-2;
f =     2.1735;
cam.k1 =    k1;
cam.k2 =    k2;
cam.nRows = nRows;
cam.nCols = nCols;
cam.Cx =    Cx;
cam.Cy =    Cy;
cam.f =     f;
cam.dx =    d;
cam.dy =    d;
cam.model = 'two_distortion_parameters';
cam.K =     sparse( [ f/d   0     Cx;
                0  f/d    Cy;
                0    0     1] );
)";

constexpr const char* heikkila = R"(% CCD camera
sys = [768, 576, 6.2031, 4.6515, 0.5, 5, 0];
par = [1.0039 8.3459 367.4321 305.8503 -3.186e-03 4.755e-05 -3.275e-05 -1.565e-05];
)";

TEST(SlamCameraFile, SceneLibsDistortionIsAFisheyes) {
  const Camera camera = parse_camera(scenelib, "SceneLib2.cfg");
  EXPECT_EQ(camera.width_px, 320);
  ASSERT_EQ(model_name(camera.lens), "kannala_brandt");
  for (double u = 2.0; u < 320.0; u += 17.0) {
    for (double v = 2.0; v < 240.0; v += 13.0) {
      const Eigen::Vector2d off(u - 162.0, v - 125.0);
      const Eigen::Vector2d ideal = off / std::sqrt(1.0 - 2.0 * 9e-6 * off.squaredNorm());  // the formula, inverted
      const auto px = project(camera, {ideal.x() / 195.0, ideal.y() / 195.0, 1.0});
      ASSERT_TRUE(px);
      EXPECT_LT((*px - Eigen::Vector2d(u, v)).norm(), 0.01) << u << ' ' << v;
    }
  }
}

TEST(SlamCameraFile, CiverasDistortionIsAnInverse) {
  const Camera camera = parse_camera(civera, "initialize_cam.m");
  EXPECT_EQ(camera.height_px, 240);
  EXPECT_NEAR(params(camera.lens)[0], 2.1735 / 0.0112, 1e-9);
  for (double u = 2.0; u < 320.0; u += 17.0) {
    for (double v = 2.0; v < 240.0; v += 13.0) {
      const Eigen::Vector2d at_mm(0.0112 * u - 1.7945, 0.0112 * v - 1.4433);
      const double r2 = at_mm.squaredNorm();
      const Eigen::Vector2d ray = at_mm * (1.0 + 6.333e-2 * r2 + 1.390e-2 * r2 * r2) / 2.1735;
      const auto px = project(camera, {ray.x(), ray.y(), 1.0});
      ASSERT_TRUE(px);
      EXPECT_LT((*px - Eigen::Vector2d(u, v)).norm(), 0.14) << u << ' ' << v;
    }
  }
}

TEST(SlamCameraFile, HeikkilasIsExact) {
  const Camera camera = parse_camera(heikkila, "sys_par.m");
  EXPECT_EQ(camera.width_px, 768);
  EXPECT_EQ(camera.height_px, 576);
  for (const Eigen::Vector3d& point :
       {Eigen::Vector3d(0.1, -0.2, 1.0), Eigen::Vector3d(-0.3, 0.25, 1.0), Eigen::Vector3d(0.31, 0.2, 1.0)}) {
    const double x = 8.3459 * point.x(), y = 8.3459 * point.y(), r2 = x * x + y * y;  // millimetres on the sensor
    const double radial = 1.0 - 3.186e-03 * r2 + 4.755e-05 * r2 * r2, t1 = -3.275e-05, t2 = -1.565e-05;
    const double u = 768.0 * 1.0039 / 6.2031 * (x * radial + 2.0 * t1 * x * y + t2 * (r2 + 2.0 * x * x)) + 367.4321;
    const double v = 576.0 / 4.6515 * (y * radial + t1 * (r2 + 2.0 * y * y) + 2.0 * t2 * x * y) + 305.8503;
    const auto px = project(camera, point);
    ASSERT_TRUE(px);
    EXPECT_LT((*px - Eigen::Vector2d(u, v)).norm(), 1e-9);
  }
}

TEST(SlamCameraFile, WhatIsMissingOrSenselessIsNamed) {
  const auto fault = [](std::string text, const std::string& from, const std::string& to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos);
    text.replace(at, from.size(), to);
    try {
      (void)parse_camera(text, "file");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("read");
  };
  EXPECT_EQ(fault(scenelib, "cam.u0 = 162;", ""), "file: cam.u0: is not given as a number");
  EXPECT_NE(fault(scenelib, "195", "-195").find("not above zero"), std::string::npos);
  EXPECT_NE(fault(scenelib, "9e-06", "1").find("hardly a pixel"), std::string::npos);
  EXPECT_NE(fault(civera, "6.333e-2", "9").find("no lens of ours"), std::string::npos);
  EXPECT_NE(fault(heikkila, "8.3459", "").find("has 7 numbers, not eight"), std::string::npos);
  EXPECT_NE(fault(heikkila, "6.2031", "0").find("not above zero"), std::string::npos);
}

}  // namespace
}  // namespace alidade
