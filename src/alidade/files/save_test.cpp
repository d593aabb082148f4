#include "alidade/results/save.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "alidade/calibrate.h"
#include "alidade/files/files.h"
#include "alidade/results/calibration_outcome.h"
#include "alidade/testing/calibration_sample.h"
#include "alidade/testing/temporary_folder.h"

namespace alidade {
namespace {

Calibration solved(int num_photos) {
  const auto scene = testing::sample_scene(testing::sample_camera("brown"), num_photos, 1);
  return calibrate(testing::sample_views(scene, 1), testing::sample_size, testing::sample_board);
}

nlohmann::json result_in(const std::filesystem::path& folder) {
  return nlohmann::json::parse(read_file(folder / "result.json"));
}

TEST(Save, LeavesWhatTheCommandLeaves) {
  const testing::TemporaryFolder folder;
  const Calibration calibration = solved(10);
  save(outcome_of(calibration), folder.path() / "out");
  for (const char* name :
       {"result.json", "report.html", "camera.yaml", "corners.csv", "poses.csv", "board_points.csv"}) {
    EXPECT_TRUE(std::filesystem::exists(folder.path() / "out" / name)) << name;
  }
  const auto result = result_in(folder.path() / "out");
  EXPECT_EQ(result["command"], "calibrate");
  EXPECT_EQ(result["counts"]["used"], 10);
  EXPECT_DOUBLE_EQ(result["estimate"]["camera"]["fx"], params(calibration.camera.lens)[0]);
}

TEST(Save, ARefusalDoesNotReplaceAnEstimate) {
  const testing::TemporaryFolder folder;
  save(outcome_of(solved(10)), folder.path());
  const std::string before = read_file(folder.path() / "camera.yaml");
  save(outcome_of(solved(1)), folder.path());
  EXPECT_EQ(read_file(folder.path() / "camera.yaml"), before);
  EXPECT_EQ(result_in(folder.path() / "refused")["verdict"]["exit_code"], 4);
}

/// It was the current folder.
TEST(Save, NeedsAFolder) { EXPECT_THROW(save(outcome_of(Calibration{}), ""), InputError); }

}  // namespace
}  // namespace alidade
