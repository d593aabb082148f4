#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "alidade/formats/camera_file.h"
#include "alidade/testing/fault.h"
#include "alidade/testing/random.h"

namespace alidade {
namespace {

using testing::fault_of;
using ::testing::HasSubstr;

Camera port_camera() {
  Params<FlatPort> p;
  p << 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 0.02, 0.01, 1.5, 1.34, 0.6, -0.0;
  return {640, 480, Calibrated<FlatPort>{p}, {}, 0.0, {}};
}

TEST(CameraFileOfAPort, APortHasItsNormalAsOneKey) {
  EXPECT_EQ(
      camera_text(port_camera(), CameraFormat::alidade),
      "model: flat_port\nwidth: 640\nheight: 480\nfx: 1.0\nfy: 2.0\ncx: 3.0\ncy: 4.0\nskew: 5.0\nk1: 6.0\nk2: 7.0\n"
      "p1: 8.0\np2: 9.0\nk3: 10.0\ngap_m: 0.02\nglass_m: 0.01\nn_glass: 1.5\nn_water: 1.34\n"
      "normal: [0.6, -0.0, 0.8]\n");
}

TEST(CameraFileOfAPort, APortReadsBackExactlyWithItsCovariance) {
  auto rng = testing::make_rng();
  std::uniform_real_distribution<> unit(-1.0, 1.0);
  for (int i = 0; i < 200; ++i) {
    Camera camera = port_camera();
    auto& p = std::get<Calibrated<FlatPort>>(camera.lens).params;
    p[10] = 0.05 + 0.04 * unit(rng);
    p.tail<2>() << 0.3 * unit(rng), 0.3 * unit(rng);
    const Eigen::MatrixXd root = Eigen::MatrixXd::NullaryExpr(16, 16, [&] { return unit(rng); });
    camera.cov = root * root.transpose();
    camera.cov = camera.cov.selfadjointView<Eigen::Upper>();
    const Camera back = parse_camera(camera_text(camera, CameraFormat::alidade), "file");
    EXPECT_EQ(params(back.lens), params(camera.lens));
    EXPECT_EQ(back.cov, camera.cov);
  }
}

TEST(CameraFileOfAPort, APortThatCannotBeIsRefused) {
  const std::string good = camera_text(port_camera(), CameraFormat::alidade);
  const auto fault_with = [&](const std::string& line, const std::string& instead) {
    std::string text = good;
    text.replace(text.find(line), line.size(), instead);
    return fault_of([&] { (void)parse_camera(text, "f"); });
  };
  EXPECT_EQ(fault_with("gap_m: 0.02", "gap_m: -0.02"), "f: gap_m: is below zero");
  EXPECT_EQ(fault_with("gap_m: 0.02\n", ""), "f: gap_m: is missing");
  EXPECT_EQ(fault_with("n_water: 1.34", "n_water: 0.5"), "f: n_water: is no refractive index (1 to 4)");
  EXPECT_THAT(fault_with("normal: [0.6, -0.0, 0.8]", "normal: [0, 0, -1]"),
              HasSubstr("f: normal: does not point away"));
  EXPECT_THAT(fault_with("normal: [0.6, -0.0, 0.8]", "normal: [0, 0]"), HasSubstr("f: normal: must be three numbers"));
  EXPECT_EQ(fault_with("normal: [0.6, -0.0, 0.8]", "normal: [0, 0, 2]"),
            "");  // its length does not matter
}

TEST(CameraFileOfAPort, NoOtherFormatHasAPort) {
  for (const CameraFormat format :
       {CameraFormat::opencv, CameraFormat::ros, CameraFormat::kalibr, CameraFormat::mrcal, CameraFormat::colmap}) {
    for (const bool lossy : {false, true}) {
      EXPECT_THAT(fault_of([&] { (void)camera_text(port_camera(), format, lossy); }),
                  HasSubstr("has no lens like flat_port; nothing was written"));
    }
  }
}

TEST(CameraFileOfAPort, WhatNeedsAViewpointRefusesAPort) {
  EXPECT_THAT(fault_of([] { require_central(port_camera(), "water.yaml"); }),
              HasSubstr("water.yaml: model: a flat_port camera has no single viewpoint"));
}

}  // namespace
}  // namespace alidade
