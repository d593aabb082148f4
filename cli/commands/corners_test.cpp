#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "alidade/simulate/boards/board_photos.h"
#include "alidade/simulate/example_camera.h"
#include "alidade/tables/corner_file.h"
#include "alidade/testing/process.h"

// `alidade corners`, and what calibrate makes of its table; photos as people have them.

namespace alidade {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;
using testing::Outcome;
using testing::run_program;

constexpr int photos_with_corners = 8;

const BoardScene& scene() {
  BoardSceneConfig config;
  config.num_photos = photos_with_corners;
  static const BoardScene drawn = draw_board_scene(*example_camera("brown", 640, 480), Board{}, config, 3);
  return drawn;
}

std::string jpeg(std::size_t i) {
  std::vector<unsigned char> bytes;
  cv::imencode(".jpg", render_board_photo(scene(), i, {}, 5), bytes, {cv::IMWRITE_JPEG_QUALITY, 98});
  return {bytes.begin(), bytes.end()};
}

/// The same with an EXIF orientation: APP1 with a TIFF directory of one entry.
std::string turned_jpeg(std::size_t i, char orientation) {
  const std::string plain = jpeg(i);
  std::string segment("Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0", 24);
  segment += orientation;
  segment += std::string(7, '\0');
  return plain.substr(0, 2) + std::string("\xFF\xE1\0", 3) + static_cast<char>(segment.size() + 2) + segment +
         plain.substr(2);
}

class Corners : public ::testing::Test {
 protected:
  Corners() { fs::create_directories(photos()); }

  [[nodiscard]] fs::path photos() const { return folder_.path() / "photos"; }
  [[nodiscard]] fs::path out(const std::string& name = "out") const { return folder_.path() / name; }
  void add_photos(std::size_t count) const {
    for (std::size_t i = 0; i < count; ++i) write_file(photos() / ("p" + std::to_string(i) + ".jpg"), jpeg(i));
  }
  [[nodiscard]] Outcome run(const std::string& command, std::vector<std::string> words,
                            const std::string& folder = "out") const {
    std::vector<std::string> line{ALIDADE_EXECUTABLE, command, "--no-report", "--out", out(folder).string()};
    if (std::find(words.begin(), words.end(), "--board") == words.end())
      line.insert(line.end(), {"--board", "9x6", "--square", "0.025"});
    line.insert(line.end(), words.begin(), words.end());
    return run_program(line);
  }
  [[nodiscard]] json result(const std::string& folder = "out") const {
    return json::parse(read_file(out(folder) / "result.json"));
  }

 private:
  testing::TemporaryFolder folder_;
};

TEST_F(Corners, AreThoseOfCalibrateWithTheResidualsInTheirCovariance) {
  add_photos(photos_with_corners);
  const Outcome outcome = run("corners", {photos().string()});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  ASSERT_EQ(run("calibrate", {photos().string()}, "camera").code, 0);
  const auto stated = read_corners(out() / "corners.csv", 54), own = read_corners(out("camera") / "corners.csv", 54);
  ASSERT_EQ(stated.size(), static_cast<std::size_t>(photos_with_corners));
  const double excess = result()["estimate"]["excess_px"];
  EXPECT_GE(excess, 0.0);
  double chi2 = 0.0, count = 0.0;
  for (std::size_t k = 0; k < stated.size(); ++k) {
    ASSERT_EQ(stated[k].corners.size(), own[k].corners.size());
    const std::vector<Eigen::Vector2d> truth = true_corners(scene(), k);
    for (std::size_t i = 0; i < stated[k].corners.size(); ++i) {
      const Corner& corner = stated[k].corners[i];
      EXPECT_LT((corner.px - own[k].corners[i].px).norm(), 1e-9);
      const Eigen::Matrix2d expected = own[k].corners[i].cov + excess * excess * Eigen::Matrix2d::Identity();
      EXPECT_LT((corner.cov - expected).norm(), 1e-9 * expected.norm());
      const Eigen::Vector2d error = corner.px - truth[static_cast<std::size_t>(corner.index)];
      chi2 += error.dot(corner.cov.inverse() * error);
      count += 2.0;
    }
  }
  EXPECT_NEAR(chi2 / count, 1.0, 0.25);  // 864 coordinates: 5 %; the residuals' part is an estimate
}

TEST_F(Corners, CalibrateFindsTheSameCameraFromTheTableAsFromThePhotos) {
  add_photos(photos_with_corners);
  const Outcome corners = run("corners", {photos().string()});
  ASSERT_EQ(corners.code, 0) << corners.err;
  EXPECT_THAT(corners.err + corners.out, HasSubstr("--size 640x480"));
  ASSERT_EQ(run("calibrate", {photos().string()}, "a").code, 0);
  ASSERT_EQ(run("calibrate", {"--corners", (out() / "corners.csv").string(), "--size", "640x480"}, "b").code, 0);
  const json a = result("a"), b = result("b");
  for (const char* name : {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"}) {
    const double sigma = a["stddev"]["camera"][name];
    EXPECT_NEAR(b["estimate"]["camera"][name].get<double>(), a["estimate"]["camera"][name].get<double>(), 2e-3 * sigma)
        << name;  // both solves end within 10⁻³ σ of the optimum
    EXPECT_NEAR(b["stddev"]["camera"][name].get<double>(), sigma, 0.02 * sigma) << name;
  }
}

TEST_F(Corners, CsvIsAllOfStdout) {
  add_photos(3);
  const Outcome outcome = run("corners", {photos().string(), "--csv"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.out, read_file(out() / "corners.csv"));
  EXPECT_THAT(outcome.out, ::testing::StartsWith("photo,corner,u_px,v_px,sigma_u_px,sigma_v_px,corr_uv\n"));
  EXPECT_EQ(run("corners", {photos().string(), "--csv", "--json"}).code, 2);
}

TEST_F(Corners, OfOnePhotoHaveTheirOwnCovarianceAndSaySo) {
  add_photos(1);
  const Outcome outcome = run("corners", {photos().string()});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("each corner's own alone"));
  EXPECT_EQ(result()["estimate"]["covariance"], "corner");
  EXPECT_EQ(result()["estimate"]["corners"], 54);
  EXPECT_EQ(result()["counts"]["used"], 1);
}

TEST_F(Corners, WithoutABoardAreARefusalThatNamesTheBoardMeant) {
  add_photos(3);
  const Outcome wrong = run("corners", {photos().string(), "--board", "10x7", "--square", "0.025"});
  EXPECT_EQ(wrong.code, 4);
  EXPECT_THAT(wrong.err, HasSubstr("use --board 9x6"));
  EXPECT_FALSE(fs::exists(out() / "corners.csv"));
}

TEST_F(Corners, ABoardGivenInSquaresIsNamedByCalibrate) {
  add_photos(photos_with_corners);
  const Outcome outcome = run("calibrate", {photos().string(), "--board", "10x7", "--square", "0.025"});
  EXPECT_EQ(outcome.code, 4);
  EXPECT_THAT(result()["verdict"]["to_add"].get<std::string>(), HasSubstr("use --board 9x6"));
}

TEST_F(Corners, SquaresInMillimetresAreAskedAbout) {
  add_photos(1);
  const Outcome outcome = run("calibrate", {photos().string(), "--board", "9x6", "--square", "25"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("give metres, 0.025, or a unit"));
}

TEST_F(Corners, PhotosTurnedByExifAreNamedAndUsedAsStored) {
  add_photos(photos_with_corners);
  ASSERT_EQ(run("calibrate", {photos().string()}, "plain").code, 0);
  write_file(photos() / "p2.jpg", turned_jpeg(2, 6));
  const Outcome outcome = run("calibrate", {photos().string()});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("turned by EXIF: p2.jpg was taken on its side, most photos upright"));
  EXPECT_EQ(result()["estimate"]["camera"], result("plain")["estimate"]["camera"]);
}

TEST_F(Corners, PhotosThatAllWereTakenOnTheirSideAreSaid) {
  for (std::size_t i = 0; i < photos_with_corners; ++i)
    write_file(photos() / ("p" + std::to_string(i) + ".jpg"), turned_jpeg(i, 6));
  const Outcome outcome = run("calibrate", {photos().string()});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("turned by EXIF: every photo was taken on its side; pixels are used as stored"));
  EXPECT_EQ(result()["estimate"]["camera"]["width"], 640);
}

TEST_F(Corners, WhatLiesBesideThePhotosIsNamed) {
  add_photos(photos_with_corners);
  write_file(photos() / "IMG_1.HEIC", "x");
  write_file(photos() / "notes.txt", "x");
  const Outcome outcome = run("calibrate", {photos().string()});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("2 files beside the photos not read, the first: IMG_1.HEIC is HEIC"));
  const std::string skipped = result()["counts"]["skipped"].dump();
  EXPECT_THAT(skipped, HasSubstr("IMG_1.HEIC"));
  EXPECT_THAT(skipped, HasSubstr("notes.txt"));
  EXPECT_EQ(result()["counts"]["given"], photos_with_corners);
  write_file(photos() / "b.heic", std::string("\0\0\0\x18", 4) + "ftypheic" + std::string(30, '\0'));
  const Outcome direct = run("calibrate", {(photos() / "b.heic").string()});
  EXPECT_EQ(direct.code, 3);
  EXPECT_THAT(direct.err, HasSubstr("convert it to JPEG or PNG without turning it"));
}

}  // namespace
}  // namespace alidade
