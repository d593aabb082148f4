#include "alidade/formats/rig_file.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/formats/camera_file.h"
#include "alidade/pantilt/rig_uncertainty.h"
#include "alidade/testing/random.h"
#include "alidade/testing/temporary_folder.h"

namespace alidade {
namespace {

class RigFile : public ::testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path write(const std::string& text) const {
    write_file(folder_.path() / "camera.yaml", camera_text(xiahou_rig()[0].camera, CameraFormat::alidade));
    write_file(folder_.path() / "rig.yaml", text);
    return folder_.path() / "rig.yaml";
  }
  [[nodiscard]] std::string refusal(const std::string& text) const {
    try {
      (void)read_rig(write(text));
    } catch (const InputError& error) {
      return error.what();
    }
    return "read without complaint";
  }
  testing::TemporaryFolder folder_;
};

Rig example_rig() {
  Rig rig;
  for (RigHead& head : xiahou_rig()) rig.heads.push_back(head);
  Head& head = rig.heads[1].head;
  head.world_from_base.rotation = exp_so3({0.1, -0.2, 0.3});
  head.pan_to_tilt_m = {0.0, 0.0, 0.012345678901234567};
  head.tilt_to_cam_m = {0.01, -0.02, 0.03};
  head.cam_from_tilt = exp_so3({0.01, 0.02, -0.03});
  head.encoder = {0.1, -0.2, 1.01, -0.99, 0.0003};
  head.axes_skew_rad = 0.004;
  const Eigen::MatrixXd root = Eigen::MatrixXd::Random(40, 30);
  rig.cov = 1e-6 * root * root.transpose();
  rig.cov.topRows(6).setZero();
  rig.cov.leftCols(6).setZero();
  return rig;
}

void expect_same(const Rig& read, const Rig& rig) {
  ASSERT_EQ(read.heads.size(), rig.heads.size());
  for (std::size_t i = 0; i < rig.heads.size(); ++i) {
    const Head &a = read.heads[i].head, &b = rig.heads[i].head;
    EXPECT_EQ(a.id, b.id);
    EXPECT_EQ(a.world_from_base.translation, b.world_from_base.translation);
    EXPECT_LE(a.world_from_base.rotation.angularDistance(b.world_from_base.rotation), 1e-15);
    EXPECT_EQ(a.pan_to_tilt_m, b.pan_to_tilt_m);
    EXPECT_EQ(a.tilt_to_cam_m, b.tilt_to_cam_m);
    EXPECT_LE(a.cam_from_tilt.angularDistance(b.cam_from_tilt), 1e-15);
    EXPECT_EQ(a.encoder, b.encoder);
    EXPECT_EQ(a.axes_skew_rad, b.axes_skew_rad);
    EXPECT_EQ(params(read.heads[i].camera.lens), params(rig.heads[i].camera.lens));
    EXPECT_EQ(read.heads[i].camera.width_px, 320);
  }
  EXPECT_EQ(read.cov, rig.cov);
  EXPECT_EQ(read.heads[0].head.encoder, rig.heads[0].head.encoder);
}

TEST_F(RigFile, ReadsBackWhatWasWritten) {
  const Rig rig = example_rig();
  expect_same(read_rig(write(rig_text(rig))), rig);
  const std::vector<std::string> files{"camera.yaml", "camera.yaml"};
  expect_same(read_rig(write(rig_text(rig, files))), rig);
}

TEST_F(RigFile, WhatIsOmittedIsZeroOrIdentity) {
  const Rig rig = read_rig(write("heads: [{camera: camera.yaml}, {id: 7, camera: camera.yaml}]\n"));
  ASSERT_EQ(rig.heads.size(), 2u);
  EXPECT_EQ(rig.heads[0].head.id, 1);
  EXPECT_EQ(rig.heads[1].head.id, 7);
  EXPECT_EQ(rig.heads[1].head.encoder, Encoder{});
  EXPECT_EQ(rig.heads[1].head.tilt_to_cam_m, Eigen::Vector3d::Zero());
  EXPECT_EQ(rig.heads[1].head.world_from_base.translation, Eigen::Vector3d::Zero());
  EXPECT_EQ(rig.heads[1].head.cam_from_tilt.w(), 1.0);
  EXPECT_EQ(rig.cov.size(), 0);
}

TEST_F(RigFile, SaysWhatIsWrongInOneLine) {
  const auto expect = [&](const std::string& text, const std::string& what) {
    const std::string said = refusal(text);
    EXPECT_NE(said.find(what), std::string::npos) << said;
    EXPECT_EQ(std::ranges::count(said, '\n'), 0) << said;
    EXPECT_NE(said.find("rig.yaml"), std::string::npos) << said;
  };
  const std::string head = "heads:\n  - camera: camera.yaml\n    ";
  expect("", "is not a table of keys");
  expect("heads: []\n", "heads: must be a list");
  expect("heads: 3\n", "heads: must be a list");
  expect("a: [\n", "is not YAML");
  expect("heads: [{camera: camera.yaml}]\nfocal: 3\n", "focal: is not a key of a rig");
  expect("heads: [{id: 1}]\n", "heads[0].camera: is missing");
  expect(head + "offset: 3\n", "heads[0].offset: is not a key of a head");
  expect(head + "encoder: {pan_zero_rad: 45}\n", "heads[0].encoder.pan_zero_rad: 45 is more than a turn; angles are");
  expect(head + "encoder: {sigma_rad: -0.1}\n", "heads[0].encoder.sigma_rad: is below zero");
  expect(head + "encoder: {pan_scale: 0}\n", "heads[0].encoder.pan_scale");
  expect(head + "encoder: {pan_zero_deg: 3}\n", "heads[0].encoder.pan_zero_deg: is not a key");
  expect(head + "pan_to_tilt_m: [0, 1]\n", "heads[0].pan_to_tilt_m: must be three numbers");
  expect(head + "pan_to_tilt_m: [0, 1, nan]\n", "'nan' is not a finite number");
  expect(head + "cam_from_tilt: {quaternion_wxyz: [1, 1, 0, 0]}\n", "has the length 1.41421, not 1");
  expect(head + "cam_from_tilt: {quaternion_wxyz: [1, 0, 0]}\n", "must be four numbers");
  expect(head + "world_from_base: {quaternion_xyzw: [0, 0, 0, 1]}\n", "quaternion_xyzw: is not a key of a pose");
  expect("heads: [{camera: camera.yaml, id: 2}, {camera: camera.yaml, id: 2}]\n", "heads[1].id: 2 appears twice");
  expect("heads: [{camera: camera.yaml, id: 1.5}]\n", "heads[0].id: 1.5 is not a whole number");
  const std::string cov = "heads: [{camera: camera.yaml}]\ncovariance: ";
  expect(cov + "{names: [head1.base_x_m], upper: [-1]}\n", "is not a covariance");
  expect(cov + "{names: [head2.base_x_m], upper: [1]}\n", "'head2.base_x_m' is no parameter of these heads");
  expect(cov + "{names: [head1.base_x_m], upper: [1, 2]}\n", "2 numbers are not the upper triangle of 1");
  EXPECT_NE(refusal("heads: [{camera: none.yaml}]\n").find("none.yaml"), std::string::npos);
}

TEST_F(RigFile, SaysWhatIsExactAndWhatHeadsShareWithLenses) {
  Rig rig;
  for (RigHead& head : xiahou_rig()) rig.heads.push_back(head);
  rig.cov.setZero(2 * num_head_params, 2 * num_head_params);
  Rig read = read_rig(write(rig_text(rig, {})));
  EXPECT_EQ(read.cov.rows(), 2 * num_head_params);
  EXPECT_TRUE(read.cov.isZero(0.0));
  EXPECT_EQ(read.cov_with_lenses.size(), 0);
  EXPECT_TRUE(std::isnan(read.encoder_errors[0].sigma_scale));

  const Eigen::Index lens = params(rig.heads[0].camera.lens).size(), size = 2 * num_head_params + 2 * lens;
  rig.cov_with_lenses.setZero(size, size);
  const std::array<Eigen::Index, 3> at{4, num_head_params + 4,
                                       2 * num_head_params + lens};  // a rotation of each base, the second's fx
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) rig.cov_with_lenses(at[i], at[j]) = i == j ? 2.0 : 0.5;
  rig.cov = rig.cov_with_lenses.topLeftCorner(2 * num_head_params, 2 * num_head_params);
  rig.encoder_errors = {{0.001, 0.002}, {}};
  rig.heads[0].head.encoder.pan_cos_rad = 0.01;
  rig.heads[0].head.encoder.tilt_sin_rad = -0.02;
  read = read_rig(write(rig_text(rig, {})));
  EXPECT_EQ(read.cov_with_lenses, rig.cov_with_lenses);
  EXPECT_EQ(read.cov, rig.cov);
  EXPECT_EQ(read.encoder_errors[0].sigma_zero_rad, 0.001);
  EXPECT_EQ(read.encoder_errors[0].sigma_scale, 0.002);
  const Eigen::MatrixXd joint = joint_covariance(read);
  EXPECT_EQ(joint(15, 15), 1e-6);  // pan zero
  EXPECT_EQ(joint(17, 17), 4e-6);  // pan scale
  EXPECT_EQ(joint(at[0], at[2]), 0.5);
}

TEST_F(RigFile, ACameraThatIsNotTheCalibratedOneIsNamed) {
  const Rig rig = example_rig();
  const std::vector<std::string> names{"camera.yaml", "camera.yaml"};
  const std::filesystem::path file = write(rig_text(rig, names));
  EXPECT_TRUE(read_rig(file).doubts.empty());
  Camera other = rig.heads[0].camera;
  Eigen::VectorXd values = params(other.lens);
  values[2] += 2.5;
  other.lens = with_params(other.lens, values);
  write_file(folder_.path() / "camera.yaml", camera_text(other, CameraFormat::alidade));
  const std::vector<std::string> changed = read_rig(file).doubts;
  ASSERT_EQ(changed.size(), 2u);
  EXPECT_NE(changed[0].find("camera.yaml has cx "), std::string::npos) << changed[0];
  (void)write("heads: [{camera: camera.yaml}]\n");  // as earlier versions wrote it
  write_file(folder_.path() / "camera.yaml", camera_text(other, CameraFormat::alidade));
  EXPECT_TRUE(read_rig(file).doubts.empty());
}

}  // namespace
}  // namespace alidade
