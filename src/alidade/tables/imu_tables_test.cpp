#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "alidade/tables/localize_file.h"
#include "alidade/testing/temporary_folder.h"

namespace alidade {
namespace {

using ::testing::HasSubstr;

class ImuTables : public ::testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path file(const std::string& text) const {
    write_file(folder_.path() / "imu", text);
    return folder_.path() / "imu";
  }
  template <typename Read>
  [[nodiscard]] std::string refusal(const Read& read, const std::string& text) const {
    try {
      (void)read(file(text));
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

 private:
  testing::TemporaryFolder folder_;
};

const std::string header = "t_s,omega_x_rad_s,omega_y_rad_s,omega_z_rad_s,force_x_m_s2,force_y_m_s2,force_z_m_s2\n";

TEST_F(ImuTables, ReadingsComeBack) {
  const std::vector<ImuReading> readings{{0.0, {0.1, -0.2, 0.3}, {0.4, -9.8, 0.25}},
                                         {0.005, {0.125, -0.25, 0.3}, {0.5, -9.75, 0.25}},
                                         {0.01, {0.1, -0.2, 0.3}, {0.4, -9.8, 0.25}}};
  const std::vector<ImuReading> read = read_imu(file(imu_csv(readings)));
  ASSERT_EQ(read.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(read[i].t_s, readings[i].t_s);
    EXPECT_EQ(read[i].rate_rad_s, readings[i].rate_rad_s);
    EXPECT_EQ(read[i].force_m_s2, readings[i].force_m_s2);
  }
}

TEST_F(ImuTables, WrongReadingsAreRefusedByLineAndColumn) {
  const auto said = [&](const std::string& text) {
    return refusal([](const auto& file) { return read_imu(file); }, text);
  };
  const std::string good = "0,0,0,0,0,-9.8,0\n";
  EXPECT_THAT(said("t_s,gx\n0,1\n"), HasSubstr("omega_x_rad_s"));
  EXPECT_THAT(said(header + good), HasSubstr("fewer than three readings"));
  EXPECT_THAT(said(header + good + good), HasSubstr(":3: column 't_s'"));
  EXPECT_THAT(said(header + good + "1,0,0,nan,0,-9.8,0\n"), HasSubstr(":3: column 'omega_z_rad_s'"));
  EXPECT_THAT(said(header + good + "1,0,0,0,0,,0\n"), HasSubstr("force_y_m_s2"));
  std::vector<SkippedInput> skipped;
  const auto read =
      read_imu(file(header + good + "1,0,0,x,0,-9.8,0\n2,0,0,0,0,-9.8,0\n3,0,0,0,0,-9.8,0\n"), true, &skipped);
  EXPECT_EQ(read.size(), 3u);
  EXPECT_EQ(skipped.size(), 1u);
}

TEST_F(ImuTables, MountingsAreOursOrKalibrs) {
  ImuMounting mounting;
  mounting.cam_from_imu = {Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), {0.06, -0.02, 0.03}};
  mounting.sigma_rotation_rad = 0.004;
  const ImuMounting read = read_imu_mounting(file(imu_mounting_text(mounting)));
  EXPECT_LT(read.cam_from_imu.rotation.angularDistance(mounting.cam_from_imu.rotation), 1e-12);
  EXPECT_EQ(read.cam_from_imu.translation, mounting.cam_from_imu.translation);
  EXPECT_EQ(read.sigma_rotation_rad, 0.004);
  // x of the IMU is z of the camera, y its x, z its y
  const ImuMounting kalibr = read_imu_mounting(
      file("T_cam_imu:\n- [0.0, 1.0, 0.0, 0.06]\n- [0.0, 0.0, 1.0, -0.02]\n- [1.0, 0.0, 0.0, 0.03]\n- [0, 0, 0, 1]\n"));
  EXPECT_LT((kalibr.cam_from_imu * Eigen::Vector3d(1.0, 0.0, 0.0) - Eigen::Vector3d(0.06, -0.02, 1.03)).norm(), 1e-12);
  const auto said = [&](const std::string& text) {
    return refusal([](const auto& file) { return read_imu_mounting(file); }, text);
  };
  EXPECT_THAT(said("translation_m: [0, 0, 0]\n"), HasSubstr("quaternion_wxyz"));
  EXPECT_THAT(said("quaternion_wxyz: [1, 1, 0, 0]\n"), HasSubstr("length"));
  EXPECT_THAT(said("quaternion_wxyz: [1, 0, 0, 0]\nsigma_rotation_rad: -1\n"), HasSubstr("sigma_rotation_rad"));
  EXPECT_THAT(said("quaternion_wxyz: [1, 0, 0, 0]\nlever: 3\n"), HasSubstr("lever"));
  EXPECT_THAT(said("T_cam_imu: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 0]]\n"), HasSubstr("rotation that is none"));
  EXPECT_THAT(said("T_cam_imu: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n"), HasSubstr("T_cam_imu"));
}

}  // namespace
}  // namespace alidade
