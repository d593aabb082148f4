#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <thread>

#include "alidade/simulate/boards/board_photos.h"
#include "alidade/simulate/example_camera.h"
#include "alidade/testing/process.h"

// `alidade calibrate` on everything that people give it by mistake: an answer in one line, and never half a file.

namespace alidade {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using ::testing::Not;
using testing::Outcome;
using testing::run_program;
using testing::TemporaryFolder;

constexpr int num_photos = 8;

cv::Mat rendered_photo(std::size_t i) {
  BoardSceneConfig config;
  config.num_photos = num_photos;
  static const BoardScene scene = draw_board_scene(*example_camera("brown", 640, 480), Board{}, config, 3);
  return render_board_photo(scene, i, {}, 5);
}

/// A folder of its own for each test, with `count` good photos in photos/.
class CalibrateSurvives : public ::testing::Test {
 protected:
  CalibrateSurvives() { fs::create_directories(photos()); }

  [[nodiscard]] fs::path photos() const { return folder_.path() / "photos"; }
  [[nodiscard]] fs::path out() const { return folder_.path() / "out"; }

  void add_photos(std::size_t count) const {
    for (std::size_t i = 0; i < count; ++i) cv::imwrite((photos() / photo_name(i)).string(), rendered_photo(i));
  }

  /// `alidade calibrate` with these words, and with the options that it needs where they are not among them.
  [[nodiscard]] Outcome calibrate(std::vector<std::string> words,
                                  const std::function<void(pid_t)>& meanwhile = {}) const {
    std::vector<std::string> line{ALIDADE_EXECUTABLE, "calibrate", "--no-report", "--out", out().string()};
    const auto add_default = [&](const std::string& option, const std::string& value) {
      if (std::find(words.begin(), words.end(), option) == words.end()) line.insert(line.end(), {option, value});
    };
    add_default("--board", "9x6");
    add_default("--square", "0.025");
    line.insert(line.end(), words.begin(), words.end());
    return run_program(line, "", meanwhile);
  }

  [[nodiscard]] json result() const { return json::parse(read_file(out() / "result.json")); }

 private:
  TemporaryFolder folder_;
};

/// One line of the common form.
void expect_one_line(const Outcome& outcome) { EXPECT_THAT(outcome.err, MatchesRegex("alidade: error: [^\n]+\n")); }

/// Bad input: exit code 3, one line, nothing written.
void expect_bad_input(const Outcome& outcome, const fs::path& out, const std::string& named) {
  EXPECT_EQ(outcome.code, 3) << outcome.err;
  expect_one_line(outcome);
  EXPECT_THAT(outcome.err, HasSubstr(named));
  EXPECT_FALSE(fs::exists(out));
}

/// A refusal: exit code 4, one line, a result that says so, and no camera.
void expect_refusal(const Outcome& outcome, const fs::path& out) {
  EXPECT_EQ(outcome.code, 4) << outcome.err;
  expect_one_line(outcome);
  ASSERT_TRUE(fs::exists(out / "result.json"));
  EXPECT_EQ(json::parse(read_file(out / "result.json"))["verdict"]["state"], "refused");
  EXPECT_FALSE(fs::exists(out / "camera.yaml"));
}

TEST_F(CalibrateSurvives, GoodPhotos) {
  add_photos(num_photos);
  const Outcome outcome = calibrate({photos().string()});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  EXPECT_THAT(outcome.out, HasSubstr("±"));
  EXPECT_TRUE(fs::exists(out() / "camera.yaml"));
  EXPECT_EQ(result()["counts"]["used"], num_photos);
}

TEST_F(CalibrateSurvives, APathThatDoesNotExist) { expect_bad_input(calibrate({"no/such.jpg"}), out(), "no/such.jpg"); }

TEST_F(CalibrateSurvives, AnEmptyFolder) { expect_bad_input(calibrate({photos().string()}), out(), photos().string()); }

TEST_F(CalibrateSurvives, ATextFileNamedJpg) {
  write_file(photos() / "notes.jpg", "not a photo\n");
  expect_bad_input(calibrate({photos().string()}), out(), "notes.jpg");
}

TEST_F(CalibrateSurvives, AnEmptyFileAmongGoodPhotosIsNamedAndTheRestGoesOn) {
  add_photos(num_photos);
  write_file(photos() / "empty.jpg", "");
  const Outcome outcome = calibrate({photos().string()});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  ASSERT_EQ(result()["counts"]["skipped"].size(), 1u);
  EXPECT_THAT(result()["counts"]["skipped"][0]["file"].get<std::string>(), HasSubstr("empty.jpg"));
}

TEST_F(CalibrateSurvives, ATruncatedJpeg) {
  add_photos(num_photos);
  std::vector<unsigned char> jpeg;
  cv::imencode(".jpg", rendered_photo(0), jpeg);
  write_file(photos() / "cut.jpg",
             std::string(jpeg.begin(), jpeg.begin() + static_cast<std::ptrdiff_t>(jpeg.size() / 3)));
  const Outcome outcome = calibrate({photos().string()});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "") << "the decoder's own words are not ours";
  EXPECT_EQ(result()["counts"]["given"], num_photos + 1);
}

TEST_F(CalibrateSurvives, APhotoOfOnePixel) {
  cv::imwrite((photos() / "tiny.png").string(), cv::Mat(1, 1, CV_8U, cv::Scalar(90)));
  expect_refusal(calibrate({photos().string()}), out());
}

TEST_F(CalibrateSurvives, TwoPhotosAreTooFew) {
  add_photos(2);
  expect_refusal(calibrate({photos().string()}), out());
}

TEST_F(CalibrateSurvives, AWrongBoardSize) {
  add_photos(4);
  expect_refusal(calibrate({photos().string(), "--board", "10x7"}), out());
}

TEST_F(CalibrateSurvives, AllPhotosIdentical) {
  for (std::size_t i = 0; i < 5; ++i) cv::imwrite((photos() / photo_name(i)).string(), rendered_photo(0));
  expect_refusal(calibrate({photos().string()}), out());
}

TEST_F(CalibrateSurvives, PhotosGivenTwiceCountOnce) {
  add_photos(num_photos);
  for (std::size_t i = 0; i < num_photos; ++i) {
    fs::copy_file(photos() / photo_name(i), photos() / ("copy_of_" + photo_name(i)));
  }
  ASSERT_EQ(calibrate({photos().string()}).code, 0);
  EXPECT_EQ(result()["counts"]["used"], num_photos);
  EXPECT_THAT(result()["counts"]["skipped"].dump(), HasSubstr("is the same image as"));
  // What was written can be read again: each corner is there once.
  EXPECT_EQ(calibrate({"--corners", (out() / "corners.csv").string()}).code, 0);
}

TEST_F(CalibrateSurvives, WrongRowsOfCornersStopOrAreNamed) {
  add_photos(num_photos);
  ASSERT_EQ(calibrate({photos().string()}).code, 0);
  const std::string table = read_file(out() / "corners.csv");
  const fs::path bad = photos().parent_path() / "bad.csv";
  write_file(bad, table.substr(0, table.find('\n') + 1));
  const Outcome empty = calibrate({"--corners", bad.string()});
  EXPECT_EQ(empty.code, 3);
  EXPECT_THAT(empty.err, HasSubstr("bad.csv: has no corners"));
  write_file(bad, table + "late.png,nan,1,2,1,1,0\n" + photo_name(0) + ",3,nan,2,1,1,0\n");
  const Outcome stopped = calibrate({"--corners", bad.string()});
  EXPECT_EQ(stopped.code, 3);
  EXPECT_THAT(stopped.err, HasSubstr("bad.csv:"));
  const Outcome named = calibrate({"--corners", bad.string(), "--skip-bad"});
  EXPECT_EQ(named.code, 0) << named.err;
  EXPECT_THAT(named.out, HasSubstr("2 wrong rows rejected, the first: "));
  const json skipped = result()["counts"]["skipped"];
  ASSERT_EQ(skipped.size(), 2u);
  EXPECT_EQ(skipped[0]["line"], std::ranges::count(table, '\n') + 1);
  EXPECT_EQ(result()["counts"]["used"], num_photos) << "no photo comes of a wrong row";
}

TEST_F(CalibrateSurvives, ASizeThatIsNotTheImagesIsNamed) {
  add_photos(num_photos);
  EXPECT_EQ(calibrate({photos().string(), "--size", "649x480"}).code, 3) << "photos have their own";
  EXPECT_FALSE(fs::exists(out()));
  ASSERT_EQ(calibrate({photos().string()}).code, 0);
  const Outcome outcome = calibrate({"--corners", (out() / "corners.csv").string(), "--size", "100x100"});
  EXPECT_EQ(outcome.code, 3);
  expect_one_line(outcome);
  EXPECT_THAT(outcome.err, HasSubstr("corners.csv: "));
  EXPECT_THAT(outcome.err, HasSubstr("check the size"));
}

TEST_F(CalibrateSurvives, APhotoOfAnotherSizeIsRefusedByName) {
  add_photos(num_photos);
  cv::Mat larger;
  cv::resize(rendered_photo(0), larger, {800, 600});
  cv::imwrite((photos() / "zother.png").string(), larger);
  const Outcome outcome = calibrate({photos().string()});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(result()["counts"]["used"], num_photos);
  const std::string skipped = result()["counts"]["skipped"].dump();
  EXPECT_THAT(skipped, HasSubstr("zother.png"));
  EXPECT_THAT(skipped, HasSubstr("800"));
}

TEST_F(CalibrateSurvives, WrongUsage) {
  add_photos(1);
  for (const std::vector<std::string>& words : {std::vector<std::string>{"--board", "9"},
                                                {"--board", "9x"},
                                                {"--board", "0x6"},
                                                {"--square", "-1"},
                                                {"--square", "nan"},
                                                {"--fix", "k9"},
                                                {"--nonsense"}}) {
    std::vector<std::string> line{photos().string()};
    line.insert(line.end(), words.begin(), words.end());
    const Outcome outcome = calibrate(line);
    EXPECT_EQ(outcome.code, 2) << words[0] << ": " << outcome.err;
    expect_one_line(outcome);
    EXPECT_FALSE(fs::exists(out()));
  }
}

TEST_F(CalibrateSurvives, CtrlCAtAnyMomentLeavesAllFilesOrNone) {
  add_photos(num_photos);
  int num_interrupted = 0;
  for (const int wait_ms : {20, 60, 120, 250}) {
    fs::remove_all(out());
    const Outcome outcome = calibrate({photos().string()}, [&](pid_t child) {
      std::this_thread::sleep_for(std::chrono::milliseconds(wait_ms));
      ::kill(child, SIGINT);
    });
    if (outcome.code == 130) {
      ++num_interrupted;
      EXPECT_FALSE(fs::exists(out())) << wait_ms;
      EXPECT_THAT(outcome.err, ::testing::AnyOf("alidade: error: interrupted; nothing written\n", ""));
    } else {
      EXPECT_EQ(outcome.code, 0) << outcome.err;
      EXPECT_TRUE(fs::exists(out() / "result.json") && fs::exists(out() / "camera.yaml"));
    }
  }
  EXPECT_GE(num_interrupted, 1) << "every run was over before it was interrupted";
}

/// The contents of a folder, file by file, without the hidden folder that a killed run leaves until the next one.
std::map<std::string, std::string> visible_files(const fs::path& folder) {
  std::map<std::string, std::string> content;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.is_regular_file()) content[entry.path().filename()] = read_file(entry.path());
  }
  return content;
}

/// The document without what differs from run to run.
json comparable(json document) {
  for (const char* key : {"argv", "created_utc", "seconds"}) document.erase(key);
  return document;
}

/// The files with the result's document comparable().
std::map<std::string, std::string> comparable(std::map<std::string, std::string> files) {
  files["result.json"] = comparable(json::parse(files.at("result.json"))).dump();
  return files;
}

TEST_F(CalibrateSurvives, ARunThatIsKilledOrFailsLeavesTheOlderResultsAsTheyWere) {
  add_photos(num_photos - 1);
  ASSERT_EQ(calibrate({photos().string()}).code, 0);
  const auto before = visible_files(out());
  add_photos(num_photos);
  int num_killed = 0;
  std::vector<std::map<std::string, std::string>> written;  // by runs that were killed after the end of their work
  for (const int wait_ms : {5, 20, 60, 120}) {
    const Outcome outcome = calibrate({photos().string()}, [&](pid_t child) {
      std::this_thread::sleep_for(std::chrono::milliseconds(wait_ms));
      ::kill(child, SIGKILL);
    });
    if (outcome.code != 128 + SIGKILL) break;  // a fast machine: it was over, and the results are its own
    ++num_killed;
    const auto left = visible_files(out());
    if (left != before) written.push_back(left);
  }
  EXPECT_GE(num_killed, 1);
  ASSERT_EQ(calibrate({photos().string()}).code, 0);
  const auto newer = visible_files(out());
  ASSERT_NE(comparable(newer), comparable(before));
  for (const auto& whole : written) EXPECT_TRUE(comparable(whole) == comparable(newer)) << "some are old, some new";
  EXPECT_EQ(calibrate({"no/such.jpg"}).code, 3);
  EXPECT_EQ(calibrate({photos().string(), "--board", "10x7"}).code, 4);
  EXPECT_TRUE(visible_files(out()) == newer) << "bad input, and data that cannot tell";
  EXPECT_EQ(json::parse(read_file(out() / "refused" / "result.json"))["verdict"]["exit_code"], 4);
  EXPECT_EQ(std::distance(fs::directory_iterator(out()), fs::directory_iterator()),
            static_cast<std::ptrdiff_t>(newer.size()) + 1)
      << "nothing hidden is left, and refused/ is new";
}

TEST_F(CalibrateSurvives, TheResultDoesNotDependOnTheNumberOfThreads) {
  add_photos(num_photos);
  ASSERT_EQ(calibrate({photos().string(), "--threads", "1"}).code, 0);
  const json one = comparable(result());
  const std::string camera = read_file(out() / "camera.yaml");
  int num_compared = 0;
  for (const char* threads : {"2", "2", "0"}) {
    ASSERT_EQ(calibrate({photos().string(), "--threads", threads}).code, 0);
    EXPECT_EQ(comparable(result()), one) << json::diff(one, comparable(result())).dump().substr(0, 500);
    EXPECT_EQ(read_file(out() / "camera.yaml"), camera);
    ++num_compared;
  }
  EXPECT_EQ(num_compared, 3);
}

TEST_F(CalibrateSurvives, JsonIsOneDocumentAlsoForARefusal) {
  add_photos(2);
  const Outcome outcome = calibrate({photos().string(), "--json"});
  EXPECT_EQ(outcome.code, 4);
  EXPECT_EQ(json::parse(outcome.out), result());
}

}  // namespace
}  // namespace alidade
