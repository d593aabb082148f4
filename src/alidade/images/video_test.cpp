#include "alidade/images/video.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <cstdlib>
#include <functional>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "alidade/files/files.h"
#include "alidade/images/video_process.h"
#include "alidade/testing/temporary_folder.h"
#include "alidade/testing/tls_server.h"

namespace alidade {
namespace {

using ::testing::HasSubstr;
using testing::TemporaryFolder;

/// An image that is recognised by its grey value.
cv::Mat plain(int value, int type = CV_8U, cv::Size size = {96, 80}) { return {size, type, cv::Scalar::all(value)}; }

void write_image(const std::filesystem::path& file, const cv::Mat& image) {
  std::vector<unsigned char> bytes;
  cv::imencode(file.extension().string(), image, bytes);
  write_file(file, std::string(bytes.begin(), bytes.end()));
}

std::string refusal(const std::function<void()>& action) {
  try {
    action();
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
    return error.what();
  }
  return "";
}

/// What is refused when a whole video is read.
std::string refusal_of(const std::filesystem::path& path) {
  return refusal([&] {
    VideoFrames video(path);
    while (!video.next().empty()) {
    }
  });
}

/// An uncompressed video, Y4M, of such plain frames of 96 × 80.
std::string raw_video(const std::vector<int>& values) {
  std::string bytes = "YUV4MPEG2 W96 H80 F30:1 Ip A1:1 C420jpeg\n";
  for (const int value : values)
    bytes += "FRAME\n" + std::string(96 * 80, static_cast<char>(value)) + std::string(2 * 48 * 40, '\x80');
  return bytes;
}

TEST(VideoFrames, OfAFolderComeInNumericOrderWithGaps) {
  const TemporaryFolder folder;
  for (const int number : {2, 3, 5, 10})
    write_image(folder.path() / fmt::format("shot{}.png", number), plain(10 * number, CV_8UC3));
  VideoFrames video(folder.path());
  EXPECT_EQ(video.num_frames(), 4u);
  for (const std::size_t number : {2u, 3u, 5u, 10u}) {
    const cv::Mat frame = video.next();
    ASSERT_EQ(frame.type(), CV_8U);
    EXPECT_EQ(frame.at<unsigned char>(40, 40), 10 * number);
    EXPECT_EQ(video.number(), number - 2);
  }
  EXPECT_TRUE(video.next().empty());
}

TEST(VideoFrames, CountsImagesWhoseNamesAreClocks) {
  const TemporaryFolder folder;
  for (const char* name : {"1403636579763555584.png", "1403636579813555456.png"})
    write_image(folder.path() / name, plain(50));
  VideoFrames video(folder.path());
  (void)video.next();
  (void)video.next();
  EXPECT_EQ(video.number(), 1u);
}

TEST(VideoFrames, OfDeepImagesKeepOneScale) {
  const TemporaryFolder folder;
  write_image(folder.path() / "1.png", plain(2000, CV_16U));  // of 12 bits: 4095
  write_image(folder.path() / "2.png", plain(1000, CV_16U));
  VideoFrames video(folder.path());
  const cv::Mat first = video.next(), second = video.next();
  ASSERT_EQ(first.type(), CV_32F);
  EXPECT_NEAR(first.at<float>(0, 0), 2000.0 * 255.0 / 2047.0, 0.01);
  EXPECT_NEAR(second.at<float>(0, 0), 1000.0 * 255.0 / 2047.0, 0.01);
}

TEST(VideoFrames, OfAFileAreDecoded) {
  const TemporaryFolder folder;
  const std::vector<int> values = {60, 120, 180};
  write_file(folder.path() / "turn.y4m", raw_video(values));
  VideoFrames video(folder.path() / "turn.y4m");
  for (const int value : values) {
    const cv::Mat frame = video.next();
    ASSERT_EQ(frame.size(), cv::Size(96, 80));
    // The decoder may take the luma as full or as television's 16 … 235.
    const int grey = frame.at<unsigned char>(40, 40);
    EXPECT_TRUE(std::abs(grey - value) <= 2 || std::abs(grey - (value - 16) * 255 / 219) <= 2) << grey;
  }
  EXPECT_TRUE(video.next().empty());
}

/// A folder that fills: each time that more is asked for, the next of these happens; then that was all.
class FillingFolder {
 public:
  explicit FillingFolder(std::vector<std::function<void()>> steps) : steps_(std::move(steps)) {}
  [[nodiscard]] MoreImages more() {
    return [this] {
      if (num_asked_ == steps_.size()) return false;
      steps_[num_asked_++]();
      return true;
    };
  }
  [[nodiscard]] std::size_t num_asked() const { return num_asked_; }

 private:
  std::vector<std::function<void()>> steps_;
  std::size_t num_asked_ = 0;
};

/// The first so many percent of an image's file; at 100 all of it.
void write_part(const std::filesystem::path& file, int value, int percent) {
  cv::Mat image = plain(value);
  for (int i = 0; i < image.rows; ++i) image.at<unsigned char>(i, i) = static_cast<unsigned char>(37 * i);
  write_image(file, image);
  const std::string bytes = read_file(file);
  write_file(file, bytes.substr(0, bytes.size() * static_cast<std::size_t>(percent) / 100));
}

TEST(VideoFrames, OfAFolderThatFillsComeWhenTheyAreWhole) {
  for (const char* ending : {".png", ".jpg", ".bmp", ".pgm", ".tif", ".webp"}) {
    const TemporaryFolder folder;
    const auto image = [&](int number) { return folder.path() / (std::to_string(number) + ending); };
    FillingFolder filling({[] {}, [&] { write_part(image(8), 80, 0); }, [&] { write_part(image(8), 80, 50); },
                           [&] { write_part(image(8), 80, 97); }, [&] { write_part(image(8), 80, 100); }, [] {},
                           [&] {
                             write_part(image(9), 90, 100);
                             write_part(image(11), 110, 50);  // 10 is missing, 11 not yet whole
                           },
                           [&] { write_part(image(11), 110, 100); }, [] {}});
    VideoFrames video(folder.path(), FrameColour::grey, filling.more());
    EXPECT_EQ(video.num_frames(), 0u);
    const std::vector<std::size_t> asked{5, 7, 8};
    for (std::size_t i = 0; i < 3; ++i) {
      const cv::Mat frame = video.next();
      const std::size_t number = i == 2 ? 11 : 8 + i;
      ASSERT_EQ(frame.size(), cv::Size(96, 80)) << ending;
      EXPECT_NEAR(frame.at<unsigned char>(79, 0), 10.0 * static_cast<double>(number), 2.0) << ending;
      EXPECT_EQ(video.number(), number - 8) << ending;
      EXPECT_EQ(filling.num_asked(), asked[i]) << ending;
    }
    EXPECT_TRUE(video.next().empty());
    EXPECT_EQ(filling.num_asked(), 9u);
  }
}

/// What is refused of a folder in which there is 5.png, and then this happens.
std::string refusal_after(const std::function<void(const std::filesystem::path&)>& step) {
  const TemporaryFolder folder;
  write_image(folder.path() / "5.png", plain(50));
  FillingFolder filling({[&] { step(folder.path()); }, [] {}});
  return refusal([&] {
    VideoFrames video(folder.path(), FrameColour::grey, filling.more());
    while (!video.next().empty()) {
    }
  });
}

TEST(VideoFrames, OfAFolderThatFillsComeInOrder) {
  EXPECT_EQ(refusal_after([](const auto& folder) { write_image(folder / "6.png", plain(60)); }), "");
  EXPECT_EQ(refusal_after([](const auto& folder) { std::filesystem::remove(folder / "5.png"); }), "");
  EXPECT_THAT(refusal_after([](const auto& folder) { write_image(folder / "4.png", plain(40)); }),
              HasSubstr("4.png: came after 5.png; images must come in order"));
  EXPECT_THAT(refusal_after([](const auto& folder) { write_part(folder / "6.png", 60, 50); }),
              HasSubstr("6.png: the image is cut off"));
  EXPECT_THAT(refusal_after([](const auto& folder) {
                write_part(folder / "6.png", 60, 50);  // and it will not be: the next one is there
                write_image(folder / "7.png", plain(70));
              }),
              HasSubstr("6.png: the image is cut off"));
}

/// Numbers that were given cannot be taken back: those of a whole folder with such a name are counts.
TEST(VideoFrames, OfAFolderThatFillsKeepTheirNumbers) {
  const TemporaryFolder folder;
  write_image(folder.path() / "5.png", plain(50));
  write_image(folder.path() / "7.png", plain(70));
  FillingFolder filling({[&] { write_image(folder.path() / "last.png", plain(80)); }});
  VideoFrames video(folder.path(), FrameColour::grey, filling.more());
  EXPECT_THAT(refusal([&] {
                while (!video.next().empty()) {
                }
              }),
              HasSubstr("images without a number of their own behind 7.png"));
}

TEST(VideoFrames, OfAFileAreNotWaitedFor) {
  const TemporaryFolder folder;
  const auto refused = [&](const std::filesystem::path& path) {
    return refusal([&] {
      VideoFrames video(path, FrameColour::grey, [] { return false; });
      (void)video.next();
    });
  };
  write_file(folder.path() / "turn.y4m", raw_video({60}));
  EXPECT_THAT(refused(folder.path() / "turn.y4m"), HasSubstr("only a folder"));
  EXPECT_THAT(refused(folder.path() / "none"), HasSubstr("no such file"));
  EXPECT_THAT(refused(folder.path()), HasSubstr("holds no photos"));
}

TEST(VideoFrames, CanBeLeftHalfway) {
  const TemporaryFolder folder;
  write_file(folder.path() / "long.y4m", raw_video(std::vector<int>(400, 90)));
  VideoFrames video(folder.path() / "long.y4m");
  EXPECT_FALSE(video.next().empty());
}

TEST(VideoFrames, RefuseWhatIsNoFolderOfImages) {
  const TemporaryFolder folder;
  EXPECT_THAT(refusal_of(folder.path() / "none"), HasSubstr("no such file"));
  EXPECT_THAT(refusal_of(folder.path()), HasSubstr("holds no photos"));
  write_file(folder.path() / "1.png", "this is a text");
  EXPECT_THAT(refusal_of(folder.path()), HasSubstr("1.png: not an image"));
  write_image(folder.path() / "1.png", plain(10));
  write_image(folder.path() / "2.png", plain(10, CV_8U, {96, 81}));
  EXPECT_THAT(refusal_of(folder.path()), HasSubstr("2.png: is 96×81, the first frame is 96×80"));
  write_image(folder.path() / "1.png", plain(10, CV_8U, {96, 20}));
  EXPECT_THAT(refusal_of(folder.path()), HasSubstr("64 pixels"));
}

TEST(VideoFrames, RefuseFilesThatAreNoVideo) {
  const TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "video.mp4";
  write_file(file, "t,pan,tilt\n0,0,0\n");
  EXPECT_THAT(refusal_of(file), HasSubstr("is a text file, not a video"));
  write_file(file, "");
  EXPECT_THAT(refusal_of(file), HasSubstr("empty"));
  std::string bytes(5000, '\0');
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<char>(i * i * 31 + i / 7);
  write_file(file, bytes);
  EXPECT_THAT(refusal_of(file), HasSubstr("not a video that can be read"));
}

/// So many frames of a film, by an encrypted connection.
TEST(VideoProcess, AServerWhoseCertificateNobodyKnowsIsNotBelieved) {
  if (!testing::TlsServer::is_installed()) GTEST_SKIP() << "openssl is not installed: openssl";
  const testing::TlsServer server("-WWW");
  write_file(server.folder() / "film.y4m", raw_video(std::vector<int>(300, 50)));
  const StreamAddress address{fmt::format("https://127.0.0.1:{}/film.y4m", server.port()), ""};
  const std::string refused = refusal([&] { (void)VideoProcess(address, FrameColour::grey); });
  EXPECT_THAT(refused, HasSubstr("certificate is not one that this machine trusts"));
  ::setenv("SSL_CERT_FILE", server.certificate().c_str(), 1);
  EXPECT_EQ(refusal([&] { EXPECT_FALSE(VideoProcess(address, FrameColour::grey).next().empty()); }), "");
  ::unsetenv("SSL_CERT_FILE");
}

}  // namespace
}  // namespace alidade
