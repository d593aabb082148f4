#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "alidade/files/csv.h"
#include "alidade/formats/camera_file.h"
#include "alidade/testing/process.h"

namespace alidade {
namespace {

using ::testing::HasSubstr;
using testing::Outcome;
using testing::TemporaryFolder;

Outcome simulate_board(const std::filesystem::path& out, std::vector<std::string> more = {}) {
  std::vector<std::string> words{ALIDADE_EXECUTABLE, "simulate", "board", "--board",   "9x6",
                                 "--square",         "0.025",    "--out", out.string()};
  words.insert(words.end(), more.begin(), more.end());
  return testing::run_program(words);
}

TEST(SimulateBoard, LeavesPhotosWithTheirTruth) {
  const TemporaryFolder folder;
  const Outcome outcome = simulate_board(folder.path(), {"--photos", "2", "--size", "320x240"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  for (const char* name : {"board_001.png", "board_002.png"}) {
    const cv::Mat photo = cv::imread((folder.path() / name).string(), cv::IMREAD_UNCHANGED);
    EXPECT_EQ(photo.size(), cv::Size(320, 240));
    EXPECT_EQ(photo.type(), CV_8U);
  }
  EXPECT_EQ(read_camera(folder.path() / "truth_camera.yaml").width_px, 320);
  EXPECT_EQ(Csv::read(folder.path() / "truth_corners.csv").num_rows(), 2u * 54u);
  EXPECT_EQ(Csv::read(folder.path() / "truth_poses.csv").num_rows(), 2u);
  EXPECT_EQ(Csv::read(folder.path() / "truth_board.csv").num_rows(), 54u);
}

TEST(SimulateRangefinder, AScenarioHasItsNumberOfShots) {
  const TemporaryFolder folder;
  const auto num_shots = [&](const std::vector<std::string>& more) {
    std::vector<std::string> words{ALIDADE_EXECUTABLE, "simulate", "rangefinder", "--out", folder.path().string()};
    words.insert(words.end(), more.begin(), more.end());
    EXPECT_EQ(testing::run_program(words).code, 0);
    return Csv::read(folder.path() / "shots.csv").num_rows();
  };
  EXPECT_EQ(num_shots({}), 18u);
  EXPECT_EQ(num_shots({"--scenario", "four_shots"}), 4u);
  EXPECT_EQ(num_shots({"--scenario", "four_shots", "--shots", "6"}), 6u);
}

TEST(SimulateBoard, CornersScatterAboutTheTruthAsTheySay) {
  const TemporaryFolder folder;
  const Outcome outcome = simulate_board(folder.path(), {"--photos", "20", "--corners-only", "--sigma-px", "0.3"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "board_001.png"));
  const Csv seen = Csv::read(folder.path() / "corners.csv"), truth = Csv::read(folder.path() / "truth_corners.csv");
  ASSERT_EQ(seen.num_rows(), 20u * 54u);
  ASSERT_EQ(truth.num_rows(), seen.num_rows());
  double chi2 = 0.0;
  for (std::size_t row = 0; row < seen.num_rows(); ++row) {
    ASSERT_EQ(seen.text(row, "photo") + seen.text(row, "corner"), truth.text(row, "photo") + truth.text(row, "corner"));
    for (const std::string axis : {"u", "v"}) {
      const double error = seen.number(row, axis + "_px") - truth.number(row, axis + "_px");
      EXPECT_DOUBLE_EQ(seen.number(row, "sigma_" + axis + "_px"), 0.3);
      chi2 += error * error / 0.09;
    }
  }
  const double dof = 2.0 * static_cast<double>(seen.num_rows());
  EXPECT_NEAR(chi2, dof, 5.0 * std::sqrt(2.0 * dof));  // five sigmas of χ²
}

TEST(SimulateBoard, TheSeedDecides) {
  const auto corners = [](const std::string& seed) {
    const TemporaryFolder folder;
    EXPECT_EQ(simulate_board(folder.path(), {"--photos", "3", "--corners-only", "--seed", seed}).code, 0);
    return read_file(folder.path() / "corners.csv");
  };
  EXPECT_EQ(corners("7"), corners("7"));
  EXPECT_NE(corners("7"), corners("8"));
}

TEST(SimulateBoard, NamesWhatIsWrong) {
  const TemporaryFolder folder;
  const auto expect = [&](const std::vector<std::string>& words, int code, const std::string& what) {
    const Outcome outcome = simulate_board(folder.path(), words);
    EXPECT_EQ(outcome.code, code) << what;
    EXPECT_THAT(outcome.err, HasSubstr(what));
  };
  expect({"--size", "320"}, 2, "--size: '320' is not WIDTHxHEIGHT");
  expect({"--size", "320x10"}, 2, "--size: '320x10' is not WIDTHxHEIGHT");
  expect({"--model", "thin"}, 2, "--model: 'thin' is not pinhole, brown, kannala_brandt or flat_port");
  expect({"--noise", "nan"}, 2, "--noise: 'nan' is not a finite number");
  expect({"--noise", "much"}, 2, "--noise: 'much' is not a finite number\n");
  expect({"--noise", "-1"}, 2, "--noise: '-1' is not within 0 to 100\n");
  expect({"--photos", "0"}, 2, "--photos");
  expect({"--camera", (folder.path() / "none.yaml").string()}, 3, "none.yaml");
}

/// FILE:NAME chooses one of a file's cameras, as everywhere.
TEST(Simulate, ReadsOneOfAFilesCameras) {
  const TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "pair.yml";
  write_file(file,
             "%YAML:1.0\n---\nimage_width: 320\nimage_height: 240\n"
             "M1: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [300, 0, 160, 0, 300, 120, 0, 0, 1]\n"
             "D1: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [0, 0, 0, 0, 0]\n"
             "M2: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [310, 0, 160, 0, 310, 120, 0, 0, 1]\n"
             "D2: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [0, 0, 0, 0, 0]\n");
  const Outcome outcome = simulate_board(folder.path(), {"--camera", file.string() + ":M2", "--corners-only"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(params(read_camera(folder.path() / "truth_camera.yaml").lens)[0], 310.0);
}

TEST(Simulate, WithoutANameListsTheScenarios) {
  const Outcome outcome = testing::run_program({ALIDADE_EXECUTABLE, "simulate"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_EQ(
      outcome.err,
      "alidade: error: simulate: a command is required: board, fleet, head, rangefinder, rig, rotation, servo, track, "
      "underwater; see alidade "
      "simulate --help\n");
}

}  // namespace
}  // namespace alidade
