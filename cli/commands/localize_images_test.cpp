#include <fmt/format.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <thread>

#include "alidade/files/files.h"
#include "alidade/tables/localize_file.h"
#include "alidade/testing/command_test.h"

namespace alidade {
namespace {

namespace fs = std::filesystem;
using testing::Outcome;
using Json = nlohmann::json;

/// A short video of a board under water, and possible faults of it.
class LocalizeImageFolders : public testing::CommandTest {
 protected:
  static constexpr int num_frames = 12;

  void SetUp() override {
    CommandTest::SetUp();
    const Outcome made = alidade({"simulate", "underwater", "--video", "--frames", std::to_string(num_frames), "--rate",
                                  "30", "--out", path("sim"), "--quiet", "--no-report"});
    ASSERT_EQ(made.code, 0) << made.err;
  }
  [[nodiscard]] std::string frame(int i) const { return path(fmt::format("sim/frames/{:06}.png", i)); }
  [[nodiscard]] Outcome localize(const std::string& sequence, const std::vector<std::string>& options) {
    return alidade(
        {"localize", path(sequence), "--camera", path("sim/camera.yaml"), "--target", path("sim/target.yaml"),
         "--truth", path("sim/truth.tum"), "--json", "--out", path("out"), "--no-report"},
        options);
  }
  void expect_refused(const std::string& sequence, const std::vector<std::string>& options, int code,
                      const std::string& what) {
    const Outcome outcome = localize(sequence, options);
    EXPECT_EQ(outcome.code, code) << what << outcome.out << outcome.err;
    EXPECT_NE(outcome.err.find(what), std::string::npos) << outcome.err;
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_FALSE(fs::exists(path("out/trajectory.tum")));
  }
};

/// At ten images a second corners are looked for as far as the next that looks alike: paths jumped by a square, with σ
/// of millimetres.
TEST_F(LocalizeImageFolders, ACornerOfABoardIsNotTakenForAnother) {
  const Outcome made = alidade({"simulate", "underwater", "--video", "--frames", "12", "--rate", "10", "--out",
                                path("sim"), "--quiet", "--no-report"});
  ASSERT_EQ(made.code, 0) << made.err;
  const Outcome outcome = localize("sim/frames", {"--rate", "10"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json estimate = Json::parse(outcome.out)["estimate"];
  EXPECT_EQ(estimate["restarts"], 0);
  EXPECT_LT(estimate["ate_m"], 0.003);
}

const std::string euroc_imu_header =
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a_RS_S_y [m "
    "s^-2],a_RS_S_z [m s^-2]\n";

TEST_F(LocalizeImageFolders, ReadsTheLayoutOfEuRoC) {
  const fs::path data = path("flight/mav0/cam0/data");
  fs::create_directories(data);
  std::string table = "#timestamp [ns],filename\n";
  for (int i = 0; i < num_frames; ++i) {
    const std::string name = fmt::format("{}.png", 1'000'000 * ((1000L * i + 15) / 30));  // whole milliseconds
    fs::copy_file(frame(i), data / name);
    table += fmt::format("{},{}\n", name.substr(0, name.size() - 4), name);
  }
  write_file(path("flight/mav0/cam0/data.csv"), table);
  const Outcome numbered = localize("sim/frames", {"--rate", "30"}), euroc = localize("flight", {});
  ASSERT_EQ(numbered.code, 0) << numbered.err;
  ASSERT_EQ(euroc.code, 0) << euroc.err;
  const Json a = Json::parse(numbered.out)["estimate"], b = Json::parse(euroc.out)["estimate"];
  EXPECT_EQ(b["frames"], num_frames);
  EXPECT_EQ(b["lost"], 0);
  EXPECT_NEAR(b["ate_m"].get<double>(), a["ate_m"].get<double>(), 2e-4);  // times are rounded to milliseconds
  // As that data set has them: times since 1970, also of its IMU.
  const auto since_1970 = [](long ns) { return 1403636579763555584L + ns; };
  std::string later = "#timestamp [ns],filename\n", imu = euroc_imu_header;
  for (int i = 0; i < num_frames; ++i)
    later += fmt::format("{},{}.png\n", since_1970(1'000'000 * ((1000L * i + 15) / 30)),
                         1'000'000 * ((1000L * i + 15) / 30));
  for (long k = -20; k < 100; ++k) imu += fmt::format("{},0,0,0,0.1,-9.79,0.5\n", since_1970(5'000'000 * k));
  write_file(path("flight/mav0/cam0/data.csv"), later);
  write_file(path("flight/mav0/imu0.csv"), imu);
  const Outcome with_imu = localize("flight", {"--imu", path("flight/mav0/imu0.csv")});
  ASSERT_EQ(with_imu.code, 0) << with_imu.err;
  EXPECT_NE(with_imu.out.find("IMU"), std::string::npos);
  EXPECT_EQ(with_imu.out.find("none of the IMU's readings is of the time of the path"), std::string::npos);
  EXPECT_TRUE(Json::parse(with_imu.out)["estimate"].contains("ate_m"));
  const std::string trajectory = read_file(path("out/trajectory.tum"));  // with the times of data.csv
  EXPECT_NE(trajectory.find("\n1403636579.76"), std::string::npos) << trajectory.substr(0, 120);
  write_file(path("flight/mav0/cam0/data.csv"), table);
  fs::remove(data / "0.png");
  const Outcome without = localize("flight", {});  // an image that is missing is a gap
  ASSERT_EQ(without.code, 0) << without.err;
  EXPECT_EQ(Json::parse(without.out)["estimate"]["frames"], num_frames - 1);
  fs::remove_all(path("out"));
  write_file(path("flight/mav0/cam0/data.csv"), table + table.substr(table.find("0,0.png")));
  fs::copy_file(frame(0), data / "0.png");
  expect_refused("flight", {}, 3, "data.csv:14: '0' is not after the time before it");
}

TEST_F(LocalizeImageFolders, NamesAImageThatCannotBe) {
  const cv::Mat small(100, 100, CV_8U, cv::Scalar(128));
  cv::imwrite(frame(5), small);
  expect_refused("sim/frames", {"--rate", "30"}, 3, "000005.png: is 100×100, the first frame is 768×576");
  write_file(frame(5), read_file(frame(4)).substr(0, 3000));
  expect_refused("sim/frames", {"--rate", "30"}, 3, "000005.png");
  write_file(frame(5), "");
  expect_refused("sim/frames", {"--rate", "30"}, 3, "000005.png");
  expect_refused("sim/frames", {}, 3, "has no times; give --rate");
}

TEST_F(LocalizeImageFolders, WhatShowsNothingIsRefused) {
  const cv::Mat grey(576, 768, CV_8U, cv::Scalar(128));
  for (int i = 0; i < num_frames; ++i) cv::imwrite(frame(i), grey);
  expect_refused("sim/frames", {"--rate", "30"}, 4, "the target is not found in any of 12 images");
  for (int i = 0; i < num_frames; ++i) cv::imwrite(frame(i), cv::Mat::zeros(576, 768, CV_8U));
  expect_refused("sim/frames", {"--rate", "30"}, 4, "the target is not found in any of 12 images");
}

/// A truth that nothing can be compared with is no truth of this path: it is named with both times, and nothing is
/// left.
TEST_F(LocalizeImageFolders, ATruthOfOtherTimesIsRefused) {
  std::vector<TimedPose> truth = read_tum(path("sim/truth.tum"));
  for (TimedPose& pose : truth) pose.t_s += 1000.0;
  write_file(path("sim/truth.tum"), tum_text(truth));
  expect_refused("sim/frames", {"--rate", "30"}, 3,
                 "truth.tum: is not of the path's times: 1000.000 to 1000.367 s, the path's are 0.000 to 0.367 s; 0 of "
                 "12 frames have a pose of their time in it");
  for (TimedPose& pose : truth) pose.t_s -= 1000.0;
  truth.resize(2);
  write_file(path("sim/truth.tum"), tum_text(truth));
  expect_refused("sim/frames", {"--rate", "30"}, 3, "2 of 12 frames have a pose of their time in it, 3 are needed");
}

/// Clean rendered images are matched better than real ones, whose least σ is 0.11 px: σ is that of what is left over,
/// unless it is given.
TEST_F(LocalizeImageFolders, TheLeastSigmaOfAMatchIsFoundOrGiven) {
  const Json usual = Json::parse(localize("sim/frames", {"--rate", "30"}).out),
             given = Json::parse(localize("sim/frames", {"--rate", "30", "--sigma-px", "0.11"}).out);
  EXPECT_LT(usual["estimate"]["sigma_px"], 0.08);
  EXPECT_GT(usual["estimate"]["sigma_px"], 0.02);
  EXPECT_EQ(given["estimate"]["sigma_px"], 0.11);
  EXPECT_LT(given["estimate"]["nis_per_dof"].get<double>(), 0.5 * usual["estimate"]["nis_per_dof"].get<double>());
  EXPECT_NE(given["verdict"]["sentence"].get<std::string>().find("--sigma-px"), std::string::npos);
}

/// Some images are missing, some are black: the path goes on, and does not call itself good.
TEST_F(LocalizeImageFolders, GapsAndBlackImagesAreCounted) {
  for (const int i : {4, 5}) cv::imwrite(frame(i), cv::Mat::zeros(576, 768, CV_8U));
  fs::remove(frame(8));
  const Outcome outcome = localize("sim/frames", {"--rate", "30"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json document = Json::parse(outcome.out);
  EXPECT_EQ(document["estimate"]["frames"], num_frames - 1);
  EXPECT_EQ(document["estimate"]["lost"], 2);
  EXPECT_EQ(document["verdict"]["state"], "care");
  EXPECT_LT(document["estimate"]["ate_m"], 0.01);
}

/// Images that are written while the command runs, each in two halves, give what the whole folder gives.
TEST_F(LocalizeImageFolders, AFolderThatFillsGivesWhatItGivesWhenFull) {
  const std::vector<std::string> words{"--camera", path("sim/camera.yaml"), "--target",   path("sim/target.yaml"),
                                       "--truth",  path("sim/truth.tum"),   "--no-report"};
  const Outcome full = alidade({"localize", path("sim/frames"), "--rate", "30", "--out", path("full")}, words);
  ASSERT_EQ(full.code, 0) << full.err;
  fs::create_directories(path("fills"));
  std::vector<std::string> command{ALIDADE_EXECUTABLE, "localize", path("fills"), "--rate",      "30",
                                   "--wait",           "3",        "--out",       path("filled")};
  command.insert(command.end(), words.begin(), words.end());
  const auto fill = [&](pid_t) {
    const auto pause = [] { std::this_thread::sleep_for(std::chrono::milliseconds(60)); };
    pause();
    for (int i = 0; i < num_frames; ++i) {
      const std::string bytes = read_file(frame(i));
      std::ofstream file(path(fmt::format("fills/{:06}.png", i)), std::ios::binary);
      file << bytes.substr(0, bytes.size() / 2) << std::flush;
      pause();
      file << bytes.substr(bytes.size() / 2) << std::flush;
    }
  };
  const Outcome filled = testing::run_program(command, "", fill);
  ASSERT_EQ(filled.code, 0) << filled.err;
  EXPECT_EQ(Json::parse(read_file(path("filled/result.json")))["estimate"].dump(),
            Json::parse(read_file(path("full/result.json")))["estimate"].dump());
  for (const char* file : {"trajectory.tum", "poses.csv", "map.csv"})
    EXPECT_EQ(read_file(path(std::string("filled/") + file)), read_file(path(std::string("full/") + file))) << file;
  const std::string poses = read_file(path("full/poses.csv"));  // its header, and so many rows
  EXPECT_EQ(filled.out.substr(0, poses.find('\n')), poses.substr(0, poses.find('\n')));
  EXPECT_GT(std::ranges::count(filled.out, '\n'), std::ranges::count(poses, '\n'));
}

/// Without a target that rows are up to scale is said as well, but not before the input has been read.
TEST_F(LocalizeImageFolders, ALiveInputThatCannotBeReadHasOneLine) {
  write_file(path("rows.csv"), "frame,t_s,point_id,u_px,v_px\n0,0,1,100,100\n1,0.1,1,nan,3\n");
  const Outcome rows =
      testing::run_program({"sh", "-c",
                            fmt::format("'{}' localize - --quiet --camera '{}' --out '{}' < '{}'", ALIDADE_EXECUTABLE,
                                        path("sim/camera.yaml"), path("out"), path("rows.csv"))});
  EXPECT_EQ(rows.code, 3);
  EXPECT_EQ(std::ranges::count(rows.err, '\n'), 1) << rows.err;
  fs::create_directories(path("broken"));
  write_file(path("broken/000000.png"), "no image");
  const Outcome images = alidade({"localize", path("broken"), "--camera", path("sim/camera.yaml"), "--rate", "30",
                                  "--wait", "0.1", "--out", path("out")});
  EXPECT_EQ(images.code, 3);
  EXPECT_EQ(std::ranges::count(images.err, '\n'), 1) << images.err;
}

TEST_F(LocalizeImageFolders, WaitsForNothingElse) {
  fs::create_directories(path("empty"));
  expect_refused("empty", {"--rate", "30", "--wait", "0.1"}, 3, "the folder holds no photos");
  expect_refused("empty", {"--rate", "30", "--wait", "0"}, 2, "--wait");
  expect_refused("sim/truth.tum", {"--rate", "30", "--wait", "0.1"}, 2, "--wait needs a folder of images");
  fs::rename(path("sim/frames"), path("empty/data"));
  write_file(path("empty/data.csv"), "#timestamp [ns],filename\n0,000000.png\n");
  expect_refused("empty", {"--wait", "0.1"}, 3, "only a folder of numbered images can be waited for");
  fs::create_directories(path("silent"));
  const Outcome stopped =
      testing::run_program({ALIDADE_EXECUTABLE, "localize", path("silent"), "--camera", path("sim/camera.yaml"),
                            "--rate", "30", "--wait", "600", "--out", path("out")},
                           "", testing::interrupt_after(std::chrono::milliseconds(200)));
  EXPECT_EQ(stopped.code, 130) << stopped.err;
  EXPECT_FALSE(fs::exists(path("out/trajectory.tum")));
}

}  // namespace
}  // namespace alidade
