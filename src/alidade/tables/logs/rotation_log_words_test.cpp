#include <gtest/gtest.h>

#include <numbers>

#include "alidade/tables/rotation_log_file.h"
#include "alidade/testing/temporary_folder.h"

// Logs as other programs write them: their words, their clocks, their separators.

namespace alidade {
namespace {

RotationLog log_in_words(const std::string& text) {
  const testing::TemporaryFolder folder;
  write_file(folder.path() / "log.csv", text);
  return read_rotation_log(folder.path() / "log.csv", {}).log;
}

TEST(RotationLogWords, ClocksInEveryUnit) {
  const auto second_row_s = [](const std::string& word, const std::string& a, const std::string& b) {
    const RotationLog log =
        log_in_words(word + ",pan,tilt,p1x,p1y\n" + a + ",0,0,300,200\n" + b + ",0.1,0.1,310,210\n");
    return log.rows[1].t_s - log.rows[0].t_s;
  };
  EXPECT_NEAR(second_row_s("time", "0", "0.1"), 0.1, 1e-12);
  EXPECT_NEAR(second_row_s("t_ns", "0", "100000000"), 0.1, 1e-12);
  EXPECT_NEAR(second_row_s("time_ms", "0", "100"), 0.1, 1e-12);
  // Since 1970 a double holds seconds to 2.4e-7.
  EXPECT_NEAR(second_row_s("timestamp", "1700000000000", "1700000000100"), 0.1, 1e-6);
  EXPECT_NEAR(second_row_s("timestamp", "1700000000000000000", "1700000000100000000"), 0.1, 1e-6);
  EXPECT_NEAR(second_row_s("t", "1700000000.0", "1700000000.1"), 0.1, 1e-6);
}

TEST(RotationLogWords, AzimuthGrowsToTheRightYawToTheLeft) {
  const RotationLog azimuth = log_in_words("t,azimuth_deg,elevation_deg,p1x,p1y\n0,0,0,300,200\n0.1,90,10,310,210\n");
  EXPECT_NEAR(azimuth.rows[1].pan_tilt_roll_rad.x(), -std::numbers::pi / 2.0, 1e-12);
  EXPECT_NEAR(azimuth.rows[1].pan_tilt_roll_rad.y(), std::numbers::pi / 18.0, 1e-12);
  const RotationLog yaw = log_in_words("t,yaw,pitch,roll,p1x,p1y\n0,0,0,0,300,200\n0.1,0.3,0.2,0.1,310,210\n");
  EXPECT_EQ(yaw.source, RotationSource::head);
  EXPECT_EQ(yaw.rows[1].pan_tilt_roll_rad, Eigen::Vector3d(0.3, 0.2, 0.1));
}

TEST(RotationLogWords, SemicolonsAndDecimalCommas) {
  const RotationLog log = log_in_words("t;pan;tilt;p1x;p1y\n0,0;0,0;0,0;300,25;200\n0,1;0,05;0,1;310;210,5\n");
  ASSERT_EQ(log.rows.size(), 2u);
  EXPECT_EQ(log.rows[1].t_s, 0.1);
  EXPECT_EQ(log.rows[0].px[0].x(), 300.25);
}

TEST(RotationLogWords, SigmaOfWhatIsGivenComesBack) {
  RotationLog log = log_in_words(
      "t,pan,tilt,p1x,p1y,sigma_scale,sigma_parallax\n0,0,0,300,200,0.001,0\n0.1,0.1,0.1,310,210,0.001,0\n");
  EXPECT_EQ(log.sigma_scale, 0.001);
  EXPECT_EQ(log.sigma_parallax, 0.0);
  const RotationLog again = log_in_words(rotation_log_csv(log));
  EXPECT_EQ(again.sigma_scale, 0.001);
  EXPECT_EQ(again.sigma_parallax, 0.0);
  EXPECT_THROW((void)log_in_words("t,pan,tilt,p1x,p1y,sigma_scale\n0,0,0,300,200,2\n0.1,0.1,0.1,310,210,2\n"),
               InputError);
}

}  // namespace
}  // namespace alidade
