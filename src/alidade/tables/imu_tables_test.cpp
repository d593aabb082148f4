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

/// The file as that data set has it: its first rows of MH_01, times in ns since 1970.
TEST_F(ImuTables, ReadsTheFileOfEuRoC) {
  const std::string euroc =
      "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a_RS_S_y [m "
      "s^-2],a_RS_S_z [m s^-2]\r\n"
      "1403636579758555392,-0.099134701513277898,0.14730578886832138,0.02722713633111154,8.1476917083333333,"
      "-0.37592158333333331,-2.4026292499999999\r\n"
      "1403636579763555584,-0.099134701513277898,0.14032447186034408,0.029321531433504733,8.033280791666666,"
      "-0.40861041666666664,-2.4026292499999999\r\n"
      "1403636579768555520,-0.098436569812480182,0.12775810124598494,0.037699111843077518,7.8861810416666662,"
      "-0.42495483333333334,-2.4353180833333332\r\n";
  const std::vector<ImuReading> read = read_imu(file(euroc), false, nullptr, 1403636579763555584);
  ASSERT_EQ(read.size(), 3u);
  EXPECT_DOUBLE_EQ(read[0].t_s, -0.005000192);
  EXPECT_EQ(read[1].t_s, 0.0);
  EXPECT_DOUBLE_EQ(read[2].t_s, 0.004999936);
  EXPECT_EQ(read[1].rate_rad_s, Eigen::Vector3d(-0.099134701513277898, 0.14032447186034408, 0.029321531433504733));
  EXPECT_EQ(read[2].force_m_s2, Eigen::Vector3d(7.8861810416666662, -0.42495483333333334, -2.4353180833333332));
  const auto said = [&](const std::string& text) {
    return refusal([](const auto& file) { return read_imu(file); }, text);
  };
  EXPECT_THAT(said("#timestamp [ns],w_RS_S_x [rad s^-1]\n0,1\n"), HasSubstr("w_RS_S_y [rad s^-1]"));
  std::string seconds = euroc;
  seconds.replace(seconds.find("1403636579768555520"), 19, "1403636579.76855552");
  EXPECT_THAT(said(seconds), HasSubstr(":4: column 'timestamp_ns'"));
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
