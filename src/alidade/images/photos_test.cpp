#include "alidade/images/photos.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "alidade/testing/temporary_folder.h"

namespace alidade {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::TemporaryFolder;

/// An image with something in it.
cv::Mat image(int type) {
  cv::Mat made(120, 160, type);
  cv::theRNG().state = 7;
  cv::randu(made, cv::Scalar::all(0), cv::Scalar::all(CV_MAT_DEPTH(type) == CV_16U ? 65535 : 255));
  return made;
}

std::string encoded(const std::string& ending, const cv::Mat& made) {
  std::vector<unsigned char> bytes;
  cv::imencode(ending, made, bytes);
  return {bytes.begin(), bytes.end()};
}

std::string refusal(const std::string& bytes) {
  try {
    (void)decode_photo(bytes);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

/// A JPEG with an APP1 segment in front, as cameras put a thumbnail there.
std::string with_segment(const std::string& jpeg, const std::string& payload) {
  const std::size_t length = payload.size() + 2;
  std::string segment = "\xFF\xE1";
  segment += static_cast<char>(length >> 8);
  segment += static_cast<char>(length & 0xFF);
  return jpeg.substr(0, 2) + segment + payload + jpeg.substr(2);
}

TEST(DecodePhoto, KeepsDepthAndValues) {
  const cv::Mat deep = image(CV_16UC1), colour = image(CV_8UC3);
  const cv::Mat read = decode_photo(encoded(".png", deep));
  ASSERT_EQ(read.type(), CV_16UC1);
  EXPECT_EQ(cv::norm(read, deep, cv::NORM_INF), 0.0);
  const cv::Mat read_colour = decode_photo(encoded(".png", colour));
  ASSERT_EQ(read_colour.type(), CV_8UC3);
  EXPECT_EQ(cv::norm(read_colour, colour, cv::NORM_INF), 0.0);
}

TEST(DecodePhoto, RefusesWhatIsNoImage) {
  EXPECT_THAT(refusal(""), HasSubstr("empty"));
  EXPECT_THAT(refusal("Dear diary, this is a text file named photo.jpg.\n"), HasSubstr("not an image"));
  EXPECT_NE(refusal("\x89PNG\r\n\x1a\n"), "");
  EXPECT_NE(refusal("\xFF\xD8\xFF"), "");
  EXPECT_NE(refusal(std::string(1000, '\0')), "");
}

TEST(DecodePhoto, RefusesWhatIsCutOffAnywhere) {
  for (const std::string ending : {".jpg", ".png", ".pgm"}) {
    const std::string whole = encoded(ending, image(CV_8UC1));
    ASSERT_EQ(refusal(whole), "") << ending;
    for (const double share : {0.1, 0.5, 0.9}) {
      const auto kept = static_cast<std::size_t>(share * static_cast<double>(whole.size()));
      EXPECT_THAT(refusal(whole.substr(0, kept)), HasSubstr("cut off")) << ending << " " << share;
    }
  }
}

TEST(DecodePhoto, TheEndOfAThumbnailIsNotTheEndOfThePhoto) {
  const std::string thumbnail = encoded(".jpg", cv::Mat(8, 8, CV_8UC1, cv::Scalar(90)));
  const std::string photo = with_segment(encoded(".jpg", image(CV_8UC1)), thumbnail);
  EXPECT_EQ(refusal(photo), "");
  EXPECT_THAT(refusal(photo.substr(0, photo.size() / 2)), HasSubstr("cut off"));
}

TEST(DecodePhoto, WhatPhonesAppendDoesNoHarm) {
  const std::string video(200000, 'v');  // "motion photos" carry a video behind the image
  EXPECT_EQ(refusal(encoded(".jpg", image(CV_8UC1)) + video), "");
}

TEST(ListPhotos, AFolderInNaturalOrder) {
  const TemporaryFolder folder;
  for (const char* name : {"img10.jpg", "img2.jpg", "img1.JPG", "img02b.png", "notes.txt", "corners.csv"}) {
    write_file(folder.path() / name, "x");
  }
  std::vector<std::string> names;
  for (const auto& file : list_photos({folder.path()})) names.push_back(file.filename().string());
  EXPECT_THAT(names, ElementsAre("img1.JPG", "img2.jpg", "img02b.png", "img10.jpg"));
}

TEST(ListPhotos, FilesStandAsGiven) {
  const TemporaryFolder folder;
  write_file(folder.path() / "b.dat", "x");
  write_file(folder.path() / "a.jpg", "x");
  const auto files = list_photos({folder.path() / "b.dat", folder.path() / "a.jpg"});
  ASSERT_EQ(files.size(), 2u);
  EXPECT_EQ(files[0].filename(), "b.dat");  // whatever its ending: the user named it
}

TEST(FindPhotos, WhatElseLiesInAFolderIsNamedWithWhatToDo) {
  const TemporaryFolder folder;
  for (const char* name : {"a.jpg", "IMG_1.HEIC", "b.nef", "c.gif", "d.pdf", "e.MOV", "notes.txt", ".hidden"}) {
    write_file(folder.path() / name, "x");
  }
  std::filesystem::create_directory(folder.path() / "more");
  const PhotoFiles found = find_photos({folder.path()});
  EXPECT_EQ(found.photos.size(), 1u);
  std::vector<std::string> lines;
  for (const SkippedInput& each : found.skipped) lines.push_back(each.file + " " + each.reason);
  EXPECT_THAT(lines, ElementsAre("IMG_1.HEIC is HEIC, which is not read: convert it to JPEG or PNG without turning it",
                                 HasSubstr("b.nef is a camera's raw file"), HasSubstr("c.gif is GIF"),
                                 HasSubstr("d.pdf is a PDF"), HasSubstr("e.MOV is a video"),
                                 HasSubstr("more is a folder within"), HasSubstr("notes.txt has no ending")));
}

TEST(FindPhotos, ResultsOfOursAreNotNamed) {
  const TemporaryFolder folder;
  write_file(folder.path() / "a.jpg", "x");
  write_file(folder.path() / "truth.yaml", "x");
  write_file(folder.path() / "report.html", "x");
  write_file(folder.path() / "result.json", R"({"schema": "alidade-result/1", "files": ["truth.yaml"]})");
  EXPECT_TRUE(find_photos({folder.path()}).skipped.empty());
  write_file(folder.path() / "result.json", "[1, 2]");
  EXPECT_EQ(find_photos({folder.path()}).skipped.size(), 3u) << "somebody else's";
}

TEST(FindPhotos, AFolderOfHeicAloneSaysSo) {
  const TemporaryFolder folder;
  write_file(folder.path() / "a.heic", "x");
  try {
    (void)find_photos({folder.path()});
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("the folder holds no photos; a.heic is HEIC, which is not read: convert it"));
  }
}

TEST(DecodePhoto, SaysWhatToDoWithKindsThatAreNotRead) {
  const auto box = [](const std::string& brand) {
    return std::string("\0\0\0\x18", 4) + "ftyp" + brand + std::string(40, '\0');
  };
  EXPECT_THAT(refusal(box("heic")), HasSubstr("convert it to JPEG or PNG without turning it"));
  EXPECT_THAT(refusal(box("mif1")), HasSubstr("is HEIC"));
  EXPECT_THAT(refusal(box("avif")), HasSubstr("is AVIF"));
  EXPECT_THAT(refusal(box("mp42")), HasSubstr("is a video"));
  EXPECT_THAT(refusal("GIF89a" + std::string(40, '\0')), HasSubstr("is GIF"));
  EXPECT_THAT(refusal("%PDF-1.7" + std::string(40, '\0')), HasSubstr("is a PDF"));
  EXPECT_THAT(refusal("image,corner,u_px,v_px\na.png,0,12.5,80.25\n"), HasSubstr("is a table, not a photo"));
}

TEST(ListPhotos, NothingThereIsSaid) {
  const TemporaryFolder folder;
  EXPECT_THROW((void)list_photos({folder.path()}), InputError);
  EXPECT_THROW((void)list_photos({folder.path() / "missing.jpg"}), InputError);
}

TEST(JpegPreview, IsSmallGreyEightBit) {
  const cv::Mat deep(400, 800, CV_16UC3, cv::Scalar(25700, 25700, 25700));
  const cv::Mat small = decode_photo(jpeg_preview(deep, 200));
  EXPECT_EQ(small.type(), CV_8UC1);
  EXPECT_EQ(small.cols, 200);
  EXPECT_EQ(small.rows, 100);
  EXPECT_NEAR(small.at<unsigned char>(50, 100), 100, 1);  // 25700 / 257; JPEG may be one off
}

}  // namespace
}  // namespace alidade
