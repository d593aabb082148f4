// Captures without a page: a folder that fills, from the executable.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <thread>

#include "alidade/files/csv.h"
#include "alidade/files/files.h"
#include "alidade/imaging/image_codecs.h"
#include "alidade/live/capture/capture_server.h"
#include "alidade/live/capture/kept_photos.h"
#include "alidade/simulate/boards/board_photos.h"
#include "alidade/simulate/example_camera.h"

namespace alidade {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

const Board nine_by_six{.cols = 9, .rows = 6, .square_m = 0.025};

class CaptureFromAFolder : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = fs::temp_directory_path() / ("alidade-capture-" + std::to_string(::getpid()));
    write_photos(nine_by_six, folder_ / "in", 14);
    write_photos({.cols = 7, .rows = 6, .square_m = 0.025}, folder_ / "other", 5);
  }
  static void TearDownTestSuite() { fs::remove_all(folder_); }

  static void write_photos(const Board& board, const fs::path& to, int num_photos) {
    Calibrated<Brown> lens;
    lens.params << 600, 602, 322, 238, 0, -0.2, 0.05, 0, 0, 0;
    const Camera camera{.width_px = 640, .height_px = 480, .lens = lens, .cov = {}, .source = ""};
    const BoardScene scene = draw_board_scene(camera, board, {.num_photos = num_photos}, 3);
    for (int i = 0; i < num_photos; ++i) {
      const auto at = static_cast<std::size_t>(i);
      write_file(to / photo_name(at), png_bytes(render_board_photo(scene, at, {}, 3)));
    }
  }

  struct Ran {
    int code;
    std::string said;
  };
  static Ran run(const std::string& arguments) {
    const fs::path said = folder_ / "said.txt";
    const std::string command =
        std::string(ALIDADE_EXECUTABLE) + " calibrate " + arguments + " >/dev/null 2>" + said.string();
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), read_file(said)};
  }
  static std::string live(const std::string& from, const std::string& out, double wait_s = 0.5) {
    return "--live --no-page --wait " + std::to_string(wait_s) + " --board 9x6 --square 0.025 --from " +
           (folder_ / from).string() + " --out " + (folder_ / out).string() + " ";
  }
  static inline fs::path folder_;
};

TEST_F(CaptureFromAFolder, KeepsPhotosFromWhichTheBatchCommandGivesTheSameCamera) {
  const Ran ran = run(live("in", "out") + "--until 0.3px");
  EXPECT_EQ(ran.code, 0) << ran.said;
  const Csv table = Csv::read(folder_ / "out" / "photos.csv");
  EXPECT_THAT(table.header(), ::testing::ElementsAre("file", "t_s", "exact"));
  ASSERT_GE(table.num_rows(), 3u);
  EXPECT_EQ(table.text(0, "file"), "000001.png");
  EXPECT_EQ(table.text(0, "exact"), "1");
  const cv::Mat photo = decode_image(read_file(folder_ / "out" / "photos" / "000001.png"));
  EXPECT_EQ(photo.type(), CV_8U);
  const Ran batch =
      run((folder_ / "out" / "photos").string() + " --board 9x6 --square 0.025 --out " + (folder_ / "batch").string());
  EXPECT_EQ(batch.code, 0) << batch.said;
  EXPECT_EQ(read_file(folder_ / "out" / "camera.yaml"), read_file(folder_ / "batch" / "camera.yaml"));
}

TEST_F(CaptureFromAFolder, GoesOnWithWhatIsKept) {
  for (int i = 1; i <= 3; ++i)
    write_file(folder_ / "few" / ("board_00" + std::to_string(i) + ".png"),
               read_file(folder_ / "in" / ("board_00" + std::to_string(i) + ".png")));
  (void)run(live("few", "resumed") + "--until 0.05px");
  const std::size_t num_first = Csv::read(folder_ / "resumed" / "photos.csv").num_rows();
  EXPECT_GE(num_first, 2u);
  const Ran again = run(live("in", "resumed"));
  EXPECT_EQ(again.code, 3);
  EXPECT_THAT(again.said, HasSubstr("--resume"));
  const Ran ran = run(live("in", "resumed") + "--until 0.3px --resume " + (folder_ / "resumed").string());
  EXPECT_EQ(ran.code, 0) << ran.said;
  const Csv table = Csv::read(folder_ / "resumed" / "photos.csv");
  EXPECT_GT(table.num_rows(), num_first);
  EXPECT_EQ(table.text(0, "file"), "000001.png");
}

TEST_F(CaptureFromAFolder, EndedFromOutsideItSaysWhereThePhotosAre) {
  const fs::path out = folder_ / "ended", said = folder_ / "ended.txt", first = out / "photos" / "000001.png";
  const std::string command = std::string(ALIDADE_EXECUTABLE) + " calibrate " + live("in", "ended", 600) +
                              "--until 0.001px >/dev/null 2>" + said.string() + " & p=$!; n=0; while [ ! -s " +
                              first.string() +
                              " ] && [ $n -lt 600 ]; do sleep 0.1; n=$((n + 1)); done; kill -TERM $p; wait $p";
  const int status = std::system(command.c_str());
  EXPECT_EQ(WEXITSTATUS(status), 128 + SIGTERM);
  EXPECT_THAT(read_file(said), HasSubstr(" in " + (out / "photos").string() + ": go on with --resume " + out.string()));
  EXPECT_THAT(read_file(said), ::testing::Not(HasSubstr("nothing written")));
}

TEST_F(CaptureFromAFolder, NamesABoardOfAnotherSizeAndAFrozenStream) {
  const Ran other = run(live("other", "none"));
  EXPECT_EQ(other.code, 4);
  EXPECT_THAT(other.said, HasSubstr("7×6"));
  EXPECT_THAT(other.said, HasSubstr("--board 7x6"));
  for (int i = 1; i <= 6; ++i)
    write_file(folder_ / "frozen" / (std::to_string(i) + ".png"), read_file(folder_ / "in" / "board_001.png"));
  const Ran frozen = run(live("frozen", "once"));
  EXPECT_EQ(frozen.code, 4);
  EXPECT_THAT(frozen.said, HasSubstr("frozen"));
  EXPECT_THAT(frozen.said, HasSubstr("not reached, there is no camera yet; go on with --resume"));
  EXPECT_EQ(Csv::read(folder_ / "once" / "photos.csv").num_rows(), 1u);
}

TEST_F(CaptureFromAFolder, SkipsHiddenFilesAndNamesWhatCannotBeRead) {
  write_file(folder_ / "mixed" / ".hidden.png", read_file(folder_ / "in" / "board_001.png"));
  write_file(folder_ / "mixed" / "broken.png", "no image");
  const Ran ran = run(live("mixed", "mixed-out", 3.0));
  EXPECT_EQ(ran.code, 4);
  EXPECT_THAT(ran.said, HasSubstr("broken.png"));
  EXPECT_EQ(Csv::read(folder_ / "mixed-out" / "photos.csv").num_rows(), 0u);
}

TEST_F(CaptureFromAFolder, RefusesOptionsThatDoNotGoTogether) {
  EXPECT_EQ(run("--live --no-page --board 9x6 --square 0.025").code, 2);
  EXPECT_EQ(run("photos --until 0.2px --board 9x6 --square 0.025").code, 2);
  EXPECT_EQ(run("photos --live=0 --board 9x6 --square 0.025").code, 2);
  EXPECT_EQ(run("--live=0 --until 0 --board 9x6 --square 0.025").code, 2);
  EXPECT_EQ(
      run("--live --no-page --from /nowhere --board 9x6 --square 0.025 --out " + (folder_ / "nowhere").string()).code,
      3);
}

TEST_F(CaptureFromAFolder, SaysWhyNoImagesComeAndLeavesNothing) {
  write_file(folder_ / "a_file", "text");
  const std::vector<std::pair<std::string, std::string>> wrong = {{"/nowhere", "no such folder"},
                                                                  {(folder_ / "a_file").string(), "is a file"},
                                                                  {"v4l2:/dev/video77", "is the camera plugged in"},
                                                                  {"http://127.0.0.1:9/stream", "nothing answers"}};
  for (const auto& [from, words] : wrong) {
    const Ran ran = run("--live --no-page --board 9x6 --square 0.025 --from " + from + " --out " +
                        (folder_ / "none_came").string());
    EXPECT_EQ(ran.code, 3) << from;
    EXPECT_THAT(ran.said, HasSubstr(from + ": "));
    EXPECT_THAT(ran.said, HasSubstr(words));
    EXPECT_FALSE(fs::exists(folder_ / "none_came")) << from;
  }
}

TEST(KeptPhotos, AreNeverRenumbered) {
  const fs::path folder = fs::temp_directory_path() / ("alidade-kept-" + std::to_string(::getpid()));
  const cv::Mat grey(48, 64, CV_8U, cv::Scalar(100));
  {
    live::KeptPhotos photos(folder, false);
    EXPECT_FALSE(photos.undo());
    photos.add(grey, 0.5, true);
    photos.add(grey, 1.5, true);
    EXPECT_TRUE(photos.undo());
    EXPECT_EQ(photos.add(grey, 2.5, false).file, "000003.png");
    photos.add(grey, 3.5, true);
    EXPECT_TRUE(photos.undo());
  }
  live::KeptPhotos again(folder, true);
  ASSERT_EQ(again.photos().size(), 2u);
  EXPECT_EQ(again.photos()[1].file, "000003.png");
  EXPECT_DOUBLE_EQ(again.photos()[1].t_s, 2.5);
  EXPECT_FALSE(again.photos()[1].is_exact);
  EXPECT_EQ(again.add(grey, 4.5, true).file, "000005.png");
  EXPECT_THROW(live::KeptPhotos(folder, false), InputError);
  fs::remove_all(folder);
  EXPECT_THROW(live::KeptPhotos(folder, true), InputError);
}

TEST(SentImage, IsOneOnlyWithItsWholeSize) {
  std::string message("ADY1\x02\0\0\0\x03\0\0\0\x01\0\0\0", 16);
  message += "abcdef";
  const auto image = live::sent_image(message);
  ASSERT_TRUE(image);
  EXPECT_EQ(image->width_px, 2);
  EXPECT_EQ(image->height_px, 3);
  EXPECT_TRUE(image->is_exact);
  EXPECT_EQ(image->grey, "abcdef");
  EXPECT_FALSE(live::sent_image(message + "g"));
  EXPECT_FALSE(live::sent_image(message.substr(0, 12)));
  message[4] = 0;
  EXPECT_FALSE(live::sent_image(message));
}

TEST(OwnOrigin, IsThisServersAlone) {
  EXPECT_TRUE(live::is_own_origin("http://127.0.0.1:8765", "127.0.0.1", 8765));
  EXPECT_TRUE(live::is_own_origin("http://localhost:8765", "127.0.0.1", 8765));
  EXPECT_FALSE(live::is_own_origin("http://evil.example:8765", "127.0.0.1", 8765));
  EXPECT_FALSE(live::is_own_origin("http://127.0.0.1:9000", "127.0.0.1", 8765));
  EXPECT_FALSE(live::is_own_origin("null", "127.0.0.1", 8765));
}

}  // namespace
}  // namespace alidade
