#include <gtest/gtest.h>

#include "alidade/files/csv.h"
#include "alidade/tables/localize_file.h"
#include "alidade/testing/temporary_folder.h"

namespace alidade {
namespace {

/// Rows of different files belong together by their times, an hour after the start and since 1970, too: a frame at
/// 1000.0333333 s that is written as 1000.03333 is after that of the truth, and a row behind it is compared.
TEST(LocalizeTables, TimesComeBackToTheNanosecond) {
  const testing::TemporaryFolder folder;
  for (const double begin_s : {0.0, 1000.0, 3600.0, 1403636579.0}) {
    std::vector<ObservationFrame> frames;
    std::vector<PathStep> path;
    std::vector<ImuReading> readings;
    for (long k = 0; k < 4; ++k) {
      const double t_s = begin_s + static_cast<double>(k) / 30.0;
      frames.push_back({k, t_s, {}});
      if (k != 2) frames.back().observations.push_back({7, {1.0, 2.0}, 0.0});
      path.emplace_back();
      path.back().frame = k;
      path.back().t_s = t_s;
      readings.push_back({t_s, {0.1, 0.2, 0.3}, {0.0, -9.81, 0.0}});
    }
    write_file(folder.path() / "sights.csv", observations_csv(frames));
    write_file(folder.path() / "imu.csv", imu_csv(readings));
    write_file(folder.path() / "poses.csv", poses_csv(path));
    const auto read = read_observations(folder.path() / "sights.csv", {}).frames;
    const auto imu = read_imu(folder.path() / "imu.csv");
    const Csv poses = Csv::read(folder.path() / "poses.csv");
    ASSERT_EQ(read.size(), 4u);
    ASSERT_EQ(imu.size(), 4u);
    ASSERT_EQ(poses.num_rows(), 4u);
    for (std::size_t k = 0; k < 4; ++k) {
      EXPECT_NEAR(read[k].t_s, frames[k].t_s, 1e-9);
      EXPECT_NEAR(imu[k].t_s, frames[k].t_s, 1e-9);
      EXPECT_NEAR(poses.number(k, "t_s"), frames[k].t_s, 1e-9);
    }
  }
}

}  // namespace
}  // namespace alidade
