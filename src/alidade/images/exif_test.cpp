#include "alidade/images/exif.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <string>

#include "alidade/images/photos.h"

namespace alidade {
namespace {

/// A whole number in some bytes, in either order.
std::string number(unsigned value, std::size_t num_bytes, bool little) {
  std::string text;
  for (std::size_t i = 0; i < num_bytes; ++i) {
    const std::size_t shift = 8 * (little ? i : num_bytes - 1 - i);
    text += static_cast<char>((value >> shift) & 0xFFU);
  }
  return text;
}

/// A TIFF directory entry with one SHORT or LONG (TIFF 6.0, section 2).
std::string entry(unsigned tag, unsigned value, bool little, bool is_long = false) {
  const std::string word = is_long ? number(value, 4, little) : number(value, 2, little) + std::string(2, '\0');
  return number(tag, 2, little) + number(is_long ? 4 : 3, 2, little) + number(1, 4, little) + word;
}

/// A TIFF of 3 × 2 grey pixels 10 20 30 / 40 50 60, uncompressed, with an orientation and another tag (0: without).
std::string tiff(unsigned orientation, bool little, unsigned other_tag = 0) {
  std::string entries;
  int count = 0;
  const auto add = [&](unsigned tag, unsigned value, bool is_long = false) {
    entries += entry(tag, value, little, is_long);
    ++count;
  };
  const unsigned num_entries = 9 + (orientation != 0 ? 1 : 0) + (other_tag != 0 ? 1 : 0);
  add(256, 3);                                   // width
  add(257, 2);                                   // height
  add(258, 8);                                   // bits
  add(259, 1);                                   // not compressed
  add(262, 1);                                   // black is zero
  add(273, 8 + 2 + 12 * num_entries + 4, true);  // where the pixels stand
  if (orientation != 0) add(274, orientation);
  add(277, 1);  // channels
  add(278, 2);  // rows in the strip
  add(279, 6, true);
  if (other_tag != 0) add(other_tag, 1, true);
  const std::string head =
      (little ? std::string("II") : std::string("MM")) + number(42, 2, little) + number(8, 4, little);
  return head + number(static_cast<unsigned>(count), 2, little) + entries + number(0, 4, little) +
         "\x0A\x14\x1E\x28\x32\x3C";
}

std::string encoded(const std::string& ending) {
  std::vector<unsigned char> bytes;
  cv::imencode(ending, cv::Mat(8, 12, CV_8UC1, cv::Scalar(90)), bytes);
  return {bytes.begin(), bytes.end()};
}

/// A JPEG with these tags in its APP1 segment.
std::string jpeg(unsigned orientation, bool little) {
  const std::string plain = encoded(".jpg"), payload = std::string("Exif\0\0", 6) + tiff(orientation, little);
  const auto length = static_cast<unsigned>(payload.size() + 2);
  return plain.substr(0, 2) + "\xFF\xE1" + number(length, 2, false) + payload + plain.substr(2);
}

/// A PNG with these tags in an eXIf chunk before its data; the check sum is not looked at.
std::string png(unsigned orientation) {
  const std::string plain = encoded(".png"), payload = tiff(orientation, false);
  const std::size_t behind_header = 8 + 12 + 13;
  return plain.substr(0, behind_header) + number(static_cast<unsigned>(payload.size()), 4, false) + "eXIf" + payload +
         std::string(4, '\0') + plain.substr(behind_header);
}

TEST(Exif, ReadsTheOrientationOfEveryKindOfFileInBothByteOrders) {
  for (unsigned orientation = 1; orientation <= 8; ++orientation) {
    for (const bool little : {true, false}) {
      EXPECT_EQ(exif_tags(jpeg(orientation, little)).orientation, static_cast<int>(orientation));
      EXPECT_EQ(exif_tags(tiff(orientation, little)).orientation, static_cast<int>(orientation));
    }
    EXPECT_EQ(exif_tags(png(orientation)).orientation, static_cast<int>(orientation));
  }
}

TEST(Exif, SaysNothingWhereTheFileDoesNot) {
  EXPECT_EQ(exif_tags("").orientation, 0);
  EXPECT_EQ(exif_tags("Dear diary").orientation, 0);
  EXPECT_EQ(exif_tags(encoded(".jpg")).orientation, 0);
  EXPECT_EQ(exif_tags(encoded(".png")).orientation, 0);
  EXPECT_EQ(exif_tags(tiff(0, true)).orientation, 0);
  EXPECT_EQ(exif_tags(tiff(9, true)).orientation, 0) << "there is no ninth";
}

TEST(Exif, BrokenFilesAnywhereDoNoHarm) {
  for (const std::string& whole : {jpeg(6, true), tiff(6, false), png(6)}) {
    for (std::size_t kept = 0; kept < std::min<std::size_t>(whole.size(), 300); ++kept) {
      EXPECT_LE(exif_tags(whole.substr(0, kept)).orientation, 8);
      std::string wrong = whole;
      wrong[kept] = '\xFF';
      EXPECT_LE(exif_tags(wrong).orientation, 8);
    }
  }
}

TEST(Exif, TellsRawFilesFromImages) {
  EXPECT_FALSE(exif_tags(tiff(1, true)).is_raw);
  EXPECT_TRUE(exif_tags(tiff(1, true, 0xC612)).is_raw);
}

TEST(Exif, PhotosAreDecodedAsStoredWhateverTheTagSays) {
  for (unsigned orientation = 0; orientation <= 8; ++orientation) {
    const cv::Mat read = decode_photo(tiff(orientation, true));
    ASSERT_EQ(read.cols, 3) << orientation;
    ASSERT_EQ(read.rows, 2) << orientation;
    EXPECT_EQ(read.at<unsigned char>(0, 0), 10) << orientation;
    EXPECT_EQ(read.at<unsigned char>(1, 2), 60) << orientation;
    if (orientation == 0) continue;
    EXPECT_EQ(decode_photo(jpeg(orientation, true)).cols, 12) << orientation;
  }
}

}  // namespace
}  // namespace alidade
