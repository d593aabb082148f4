#include "alidade/imaging/image_codecs.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "alidade/imaging/image_size.h"
#include "alidade/imaging/tiff_image.h"
#include "alidade/testing/random.h"

namespace alidade {
namespace {

cv::Mat noise(int type, int width = 37, int height = 23) {
  cv::Mat image(height, width, type);
  auto rng = testing::make_rng();
  cv::RNG random(rng());
  random.fill(image, cv::RNG::UNIFORM, 0, image.depth() == CV_16U ? 65536 : 256);
  return image;
}

std::string encoded(const std::string& ending, const cv::Mat& image, const std::vector<int>& options = {}) {
  std::vector<unsigned char> bytes;
  cv::imencode(ending, image, bytes, options);
  return {bytes.begin(), bytes.end()};
}

cv::Mat by_opencv(const std::string& bytes, int flags) {
  const cv::Mat raw(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data()));
  return cv::imdecode(raw, flags);
}

constexpr int as_stored = cv::IMREAD_ANYDEPTH | cv::IMREAD_ANYCOLOR | cv::IMREAD_IGNORE_ORIENTATION;

void expect_same(const cv::Mat& ours, const cv::Mat& theirs, const std::string& what) {
  ASSERT_EQ(ours.type(), theirs.type()) << what;
  ASSERT_EQ(ours.size(), theirs.size()) << what;
  EXPECT_EQ(cv::norm(ours, theirs, cv::NORM_INF), 0.0) << what;
}

/// A few hundred bytes that announce a gigapixel are refused before room is made for it; a blank page is read.
TEST(ImageCodecs, MakeNoRoomForMoreThanAFileCanHold) {
  EXPECT_FALSE(is_possible_image(30000, 30000, 205));
  EXPECT_FALSE(is_possible_image(0, 480, 1000));
  EXPECT_TRUE(is_possible_image(640, 480, 205));
  const cv::Mat page(8000, 6000, CV_8U, cv::Scalar(255));
  for (const char* const ending : {".png", ".tiff", ".jpg"}) {
    const std::string bytes = encoded(ending, page);
    expect_same(decode_image(bytes), page, ending);
  }
  const std::string one_bit = encoded(".png", page, {cv::IMWRITE_PNG_BILEVEL, 1, cv::IMWRITE_PNG_COMPRESSION, 9});
  expect_same(decode_image(one_bit), page, "one bit");
}

/// What OpenCV writes is read as OpenCV reads it, to the last bit.
TEST(ImageCodecs, ReadWhatOpencvReads) {
  for (const char* ending : {".jpg", ".png", ".tiff", ".bmp", ".pnm", ".webp"}) {
    for (const int type : {CV_8UC1, CV_8UC3, CV_16UC1, CV_16UC3}) {
      const bool has_16 =
          std::string(ending) == ".png" || std::string(ending) == ".tiff" || std::string(ending) == ".pnm";
      if (CV_MAT_DEPTH(type) == CV_16U && !has_16) continue;
      const std::string bytes = encoded(ending, noise(type));
      expect_same(decode_image(bytes), by_opencv(bytes, as_stored), ending + std::string(" ") + std::to_string(type));
    }
  }
}

TEST(ImageCodecs, SayWhyATiffIsNoPhoto) {
  const std::string floats = encoded(".tiff", cv::Mat(20, 30, CV_32FC1, cv::Scalar(0.5)));
  EXPECT_TRUE(decode_image(floats).empty());
  EXPECT_EQ(foreign_numbers(floats), "a TIFF of 32-bit floating-point numbers: save it with 8 or 16 bits");
  for (const int type : {CV_8UC1, CV_16UC3}) EXPECT_EQ(foreign_numbers(encoded(".tiff", noise(type))), "");
  EXPECT_EQ(foreign_numbers(encoded(".png", noise(CV_8UC1))) + foreign_numbers("II") + foreign_numbers(""), "");
}

TEST(ImageCodecs, ReadTiffsOfEveryCompression) {
  for (const int compression : {1, 5, 8, 32773}) {  // none, LZW, deflate, packed bits
    for (const int type : {CV_8UC1, CV_8UC3, CV_16UC1, CV_16UC3}) {
      const std::string bytes = encoded(".tiff", noise(type, 300, 200), {cv::IMWRITE_TIFF_COMPRESSION, compression});
      expect_same(decode_image(bytes), by_opencv(bytes, as_stored), std::to_string(compression));
    }
  }
}

TEST(ImageCodecs, KeepTransparencyWhereAsked) {
  for (const int type : {CV_8UC4, CV_16UC4}) {
    const std::string bytes = encoded(".png", noise(type));
    expect_same(decode_image(bytes, true), by_opencv(bytes, cv::IMREAD_UNCHANGED), "kept");
    expect_same(decode_image(bytes), by_opencv(bytes, as_stored), "dropped");
  }
}

TEST(ImageCodecs, ProgressiveJpegsAndQuality) {
  cv::Mat smooth;
  cv::GaussianBlur(noise(CV_8UC3, 640, 480), smooth, {}, 3.0);
  for (const int quality : {5, 75, 100}) {
    const std::string bytes =
        encoded(".jpg", smooth, {cv::IMWRITE_JPEG_QUALITY, quality, cv::IMWRITE_JPEG_PROGRESSIVE, 1});
    expect_same(decode_image(bytes), by_opencv(bytes, as_stored), std::to_string(quality));
  }
}

TEST(ImageCodecs, WriteWhatTheyRead) {
  for (const int type : {CV_8UC1, CV_8UC3, CV_8UC4, CV_16UC1, CV_16UC3}) {
    const cv::Mat image = noise(type);
    expect_same(decode_image(png_bytes(image), true), image, std::to_string(type));
    expect_same(by_opencv(png_bytes(image), cv::IMREAD_UNCHANGED), image, "by OpenCV");
  }
  for (const int type : {CV_8UC1, CV_8UC3}) {
    const cv::Mat image = noise(type);
    const std::string theirs = encoded(".jpg", image, {cv::IMWRITE_JPEG_QUALITY, 75});
    expect_same(decode_image(jpeg_bytes(image, 75)), by_opencv(theirs, as_stored), "jpeg");
  }
  EXPECT_THROW((void)png_bytes(cv::Mat(2, 2, CV_32F)), std::invalid_argument);
  EXPECT_THROW((void)png_bytes(cv::Mat()), std::invalid_argument);
  EXPECT_THROW((void)jpeg_bytes(noise(CV_16UC1), 75), std::invalid_argument);
}

/// Cut off, or with bytes changed: an empty image or another one, never a fault.
TEST(ImageCodecs, SurviveBrokenFiles) {
  auto rng = testing::make_rng();
  for (const char* ending : {".jpg", ".png", ".tiff", ".bmp", ".pnm", ".webp"}) {
    const std::string whole = encoded(ending, noise(CV_8UC3));
    for (std::size_t size = 0; size < whole.size(); size += 1 + whole.size() / 97) {
      (void)decode_image(std::string_view(whole).substr(0, size));
    }
    for (int i = 0; i < 300; ++i) {
      std::string broken = whole;
      for (int k = 0; k < 4; ++k) broken[rng() % std::min<std::size_t>(broken.size(), 200)] = static_cast<char>(rng());
      (void)decode_image(broken);
    }
  }
  EXPECT_TRUE(decode_image("").empty());
  EXPECT_TRUE(decode_image("not an image").empty());
}

}  // namespace
}  // namespace alidade
