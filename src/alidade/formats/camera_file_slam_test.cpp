#include <gtest/gtest.h>

#include <cmath>

#include "alidade/files/files.h"
#include "alidade/formats/camera_file.h"
#include "alidade/testing/temporary_folder.h"

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

/// As the toolbox writes it; against its own equations.
TEST(SlamCameraFile, BouguetsIsExact) {
  const std::string text =
      "% Intrinsic and Extrinsic Camera Parameters\n%-- Focal length:\n"
      "fc = [ 657.643749676532490 ; 658.041127811203660 ];\n%-- Principal point:\n"
      "cc = [ 303.192390 ; 242.555660 ];\nalpha_c = 0.00042;\n"
      "kc = [ -0.25610 ; 0.13089 ; -0.00019 ; 0.00004 ; 0.02 ];\n"
      "fc_error = [ 0.40243 ; 0.43056 ];\nnx = 640;\nny = 480;\nn_ima = 25;\t\nest_dist = [ 1 ; 1 ; 1 ; 1 ; 0 ];\n";
  const Camera camera = parse_camera(text, "Calib_Results.m");
  EXPECT_EQ(camera.width_px, 640);
  EXPECT_EQ(camera.height_px, 480);
  for (const Eigen::Vector2d& x :
       {Eigen::Vector2d(0.1, -0.2), Eigen::Vector2d(-0.4, 0.3), Eigen::Vector2d(0.45, 0.3)}) {
    const double r2 = x.squaredNorm();
    const double radial = 1.0 - 0.25610 * r2 + 0.13089 * r2 * r2 + 0.02 * r2 * r2 * r2, p1 = -0.00019, p2 = 0.00004;
    const double xd = radial * x[0] + 2.0 * p1 * x[0] * x[1] + p2 * (r2 + 2.0 * x[0] * x[0]);
    const double yd = radial * x[1] + p1 * (r2 + 2.0 * x[1] * x[1]) + 2.0 * p2 * x[0] * x[1];
    const Eigen::Vector2d expected(657.643749676532490 * (xd + 0.00042 * yd) + 303.192390,
                                   658.041127811203660 * yd + 242.555660);
    const auto px = project(camera, {2.0 * x[0], 2.0 * x[1], 2.0});
    ASSERT_TRUE(px);
    EXPECT_LT((*px - expected).norm(), 1e-9);
  }
  const auto fault = [](const std::string& changed, const std::string& choice = "") {
    try {
      (void)parse_camera(changed, "m", choice);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("read");
  };
  EXPECT_NE(fault(text, "left").find("leave ':left' out"), std::string::npos);
  EXPECT_EQ(fault(text.substr(0, text.find("nx ="))), "m: nx: is not given as a number");
  for (const char* wrong : {"nan", "-inf", "1e300"}) {
    std::string changed = text;
    EXPECT_EQ(fault(changed.replace(changed.find("-0.25610"), 8, wrong)),
              "m: has a number that is not finite, or beyond 1e12");
  }
  EXPECT_EQ(fault("fc = [1 ; 2 ; 3]; cc = [1 ; 2]; kc = zeros(5,1);\n fc_error = [1 ; 2];"),
            "m: is not a camera file of alidade, OpenCV, ROS, Kalibr, mrcal, COLMAP, SceneLib, Civera, Heikkilä or "
            "Bouguet");
  EXPECT_EQ(fault("fc = [1 ; 2 ; 3]; cc = [1 ; 2]; kc = [0 ; 0 ; 0 ; 0 ; 0];"), "m: fc: has 3 numbers");
}

/// Four coefficients are those of its fisheye, or of an old version.
TEST(SlamCameraFile, FourCoefficientsOfBouguetAreAskedAbout) {
  const testing::TemporaryFolder folder;
  const std::string file = (folder.path() / "Calib_Results.m").string();
  write_file(
      file, "fc = [ 300 ; 301 ];\ncc = [ 320 ; 240 ];\nkc = [ 0.02 ; 0.01 ; -0.004 ; 0.001 ];\nnx = 640;\nny = 480;\n");
  EXPECT_EQ(model_name(read_camera(file).lens), "brown");
  EXPECT_NE(lens_doubt(file).find("k1 k2 k3 k4 of the toolbox's fisheye"), std::string::npos);
  const Camera fisheye = read_camera(file + ":fisheye");
  EXPECT_EQ(model_name(fisheye.lens), "kannala_brandt");
  EXPECT_EQ(params(fisheye.lens)[8], 0.001);
  EXPECT_EQ(lens_doubt(file + ":fisheye") + lens_doubt(file + ":brown"), "");
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
