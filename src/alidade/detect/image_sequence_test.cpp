#include "alidade/detect/image_sequence.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <vector>

#include "alidade/files/files.h"
#include "alidade/testing/fault.h"
#include "alidade/testing/temporary_folder.h"

namespace alidade {
namespace {

using testing::fault_of;
using ::testing::HasSubstr;

struct Times {
  std::vector<double> of_frames_s;
  double own_rate_hz = 0.0;
};

/// Times of five frames of 96 × 80, of an uncompressed video (Y4M) with so many a second.
Times times_of(const std::string& frames_per_s, double rate_hz) {
  const testing::TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "walk.y4m";
  std::string bytes = fmt::format("YUV4MPEG2 W96 H80 F{} Ip A1:1 C420jpeg\n", frames_per_s);
  for (int i = 0; i < 5; ++i) bytes += "FRAME\n" + std::string(96 * 80, 'a') + std::string(2 * 48 * 40, '\x80');
  write_file(file, bytes);
  Camera camera;
  camera.width_px = 96;
  camera.height_px = 80;
  const ImageStream images = images_in(file, camera, rate_hz);
  std::vector<double> times_s;
  cv::Mat grey;
  long frame = 0;
  for (double t_s = 0.0; images.next(grey, frame, t_s);) {
    EXPECT_EQ(frame, static_cast<long>(times_s.size()));
    times_s.push_back(t_s);
  }
  return {times_s, images.own_rate_hz()};
}

TEST(ImageSequence, AVideoHasItsTimes) {
  using ::testing::DoubleNear;
  using ::testing::ElementsAre;
  const auto near = [](double value) { return DoubleNear(value, 1e-9); };
  EXPECT_THAT(times_of("25:1", 0.0).of_frames_s,
              ElementsAre(near(0.0), near(0.04), near(0.08), near(0.12), near(0.16)));
  EXPECT_THAT(times_of("25:1", 50.0).of_frames_s,
              ElementsAre(near(0.0), near(0.02), near(0.04), near(0.06), near(0.08)));
}

TEST(ImageSequence, ARateBesideTimesIsComparedWithThem) {
  EXPECT_NEAR(times_of("25:1", 50.0).own_rate_hz, 25.0, 1e-9);
  EXPECT_EQ(times_of("25:1", 0.0).own_rate_hz, 0.0);
  // EuRoC's table: 20 images a second.
  const testing::TemporaryFolder folder;
  std::filesystem::create_directories(folder.path() / "data");
  write_file(folder.path() / "data" / "1.png", "");
  write_file(folder.path() / "data" / "2.png", "");
  write_file(folder.path() / "data.csv", "#timestamp [ns],filename\n1000000000,1.png\n1050000000,2.png\n");
  (void)images_in(folder.path(), Camera{}, 20.0);
  EXPECT_THAT(fault_of([&] { (void)images_in(folder.path(), Camera{}, 30.0); }),
              HasSubstr("has times, 20 images a second; leave --rate 30 out"));
}

TEST(ImageSequence, AFolderHasNone) {
  const testing::TemporaryFolder folder;
  write_file(folder.path() / "1.png", "");
  EXPECT_THAT(fault_of([&] { (void)images_in(folder.path(), Camera{}, 0.0); }), HasSubstr("has no times; give --rate"));
}

}  // namespace
}  // namespace alidade
