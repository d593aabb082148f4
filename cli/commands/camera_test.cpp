#include "cli/commands/camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <thread>

#include "alidade/camera/undistort.h"
#include "alidade/formats/camera_file.h"
#include "alidade/testing/process.h"

namespace alidade::cli {
namespace {

using alidade::testing::Outcome;
using ::testing::HasSubstr;
using ::testing::Not;

Camera brown_camera() {
  Camera camera{160,
                120,
                Calibrated<Brown>{Params<Brown>{120, 121, 80.2, 59.1, 0, -0.25, 0.1, 0.001, -0.0005, -0.02}},
                Eigen::MatrixXd::Zero(10, 10),
                0.12,
                "13 photos"};
  camera.cov.diagonal() << 0.25, 0.25, 0.04, 0.04, 0, 1e-6, 4e-6, 1e-8, 1e-8, 1e-6;
  return camera;
}

/// Files of a test and the commands run among them.
struct CameraCommand : ::testing::Test {
  Outcome alidade(std::vector<std::string> words) {
    words.insert(words.begin(), {ALIDADE_EXECUTABLE, "camera"});
    return alidade::testing::run_program(words, folder.path().string());
  }
  void write(const std::string& name, const Camera& camera, CameraFormat format = CameraFormat::alidade) {
    write_file(folder.path() / name, camera_text(camera, format, true));
  }
  nlohmann::json result(const std::string& out) {
    return nlohmann::json::parse(read_file(folder.path() / out / "result.json"));
  }
  bool exists(const std::string& name) { return std::filesystem::exists(folder.path() / name); }

  alidade::testing::TemporaryFolder folder;
};

TEST_F(CameraCommand, ShowTellsValuesViewAndSigma) {
  write("a.yaml", brown_camera());
  const Outcome outcome = alidade({"show", "a.yaml"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("brown, 160 × 120 px (13 photos)"));
  EXPECT_THAT(outcome.out, HasSubstr("fx   120.0 ± 1.5 px"));
  EXPECT_THAT(outcome.out, HasSubstr("RMS 0.120 px per point"));
  EXPECT_THAT(outcome.out, HasSubstr("3σ of projection"));
  EXPECT_FALSE(exists("alidade-out")) << "show leaves nothing behind";
  const auto document = nlohmann::json::parse(alidade({"show", "a.yaml", "--json"}).out);
  EXPECT_EQ(document["estimate"]["camera"]["fx"], 120.0);
  EXPECT_EQ(document["stddev"]["camera"]["fx"], 0.5);
  EXPECT_EQ(document["inputs"][0]["name"], "a.yaml");
}

TEST_F(CameraCommand, ShowWarnsOfAImageThatSeesNothingInItsCorners) {
  Camera camera = brown_camera();
  camera.lens = Calibrated<Brown>{Params<Brown>{90, 90, 80, 60, 0, -0.45, 0.07, 0, 0, 0}};
  write("a.yaml", camera);
  EXPECT_THAT(alidade({"show", "a.yaml"}).out, HasSubstr("of the image sees nothing"));
}

TEST_F(CameraCommand, ConvertWritesExactlyTheDestinationInEveryFormat) {
  write("a.yaml", brown_camera());
  for (const char* format : {"opencv", "ros", "mrcal", "colmap", "alidade"}) {
    const std::string file = std::string("sub/") + format;
    const Outcome outcome = alidade({"convert", "a.yaml", file, "--to", format});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    const Camera back = read_camera(folder.path() / file);
    EXPECT_EQ(params(back.lens), params(brown_camera().lens)) << format;
    const bool keeps_covariance = std::string(format) == "alidade";
    EXPECT_EQ(outcome.out.find("cannot hold the covariance") == std::string::npos, keeps_covariance) << format;
  }
  EXPECT_FALSE(exists("alidade-out"));
}

// As root it left files in place of a device, a pipe and a link.
TEST_F(CameraCommand, ConvertWritesToPipesAndThroughLinks) {
  write("a.yaml", brown_camera());
  ASSERT_EQ(alidade({"convert", "a.yaml", "ros.yaml", "--to", "ros"}).code, 0);
  const std::string expected = read_file(folder.path() / "ros.yaml");
  ASSERT_EQ(::mkfifo((folder.path() / "pipe").c_str(), 0600), 0);
  std::string got;
  std::thread reader([&] { got = read_file(folder.path() / "pipe"); });
  EXPECT_EQ(alidade({"convert", "a.yaml", "pipe", "--to", "ros"}).code, 0);
  reader.join();
  EXPECT_EQ(got, expected);
  EXPECT_TRUE(std::filesystem::is_fifo(folder.path() / "pipe"));
  std::filesystem::create_symlink("target.yaml", folder.path() / "link.yaml");
  EXPECT_EQ(alidade({"convert", "a.yaml", "link.yaml", "--to", "ros"}).code, 0);
  EXPECT_TRUE(std::filesystem::is_symlink(folder.path() / "link.yaml"));
  EXPECT_EQ(read_file(folder.path() / "target.yaml"), expected);
}

TEST_F(CameraCommand, ConvertRefusesToLoseTheLensUnlessAllowed) {
  write("a.yaml", brown_camera());
  const Outcome refused = alidade({"convert", "a.yaml", "b.yaml", "--to", "kalibr"});
  EXPECT_EQ(refused.code, 3);
  EXPECT_EQ(refused.err,
            "alidade: error: a.yaml: the format kalibr cannot hold k3 -0.02; --lossy writes the nearest "
            "without\n");
  EXPECT_FALSE(exists("b.yaml"));
  const Outcome given = alidade({"convert", "a.yaml", "b.yaml", "--to", "kalibr", "--lossy"});
  EXPECT_EQ(given.code, 0);
  EXPECT_THAT(given.out, HasSubstr("without k3 -0.02: the other terms are fitted anew, "));
  EXPECT_THAT(given.out, HasSubstr("px off at worst over the image"));
  EXPECT_TRUE(exists("b.yaml"));
}

// A fisheye of cv2.fisheye was read as a brown lens without a word.
TEST_F(CameraCommand, FourCoefficientsOfOpenCvAreAskedAbout) {
  write_file(folder.path() / "c.yml",
             "%YAML:1.0\n---\nimage_width: 160\nimage_height: 120\n"
             "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 90, 0, 80, 0, 90, 60, 0, 0, "
             "1 ]\ndistortion_coefficients: !!opencv-matrix\n   rows: 4\n   cols: 1\n   dt: d\n"
             "   data: [ 0.02, 0.01, -0.004, 0.001 ]\n");
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"show", "c.yml"}, {"convert", "c.yml", "b.yaml"}, {"diff", "c.yml", "c.yml:brown"}}) {
    const Outcome outcome = alidade(words);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_THAT(outcome.out, HasSubstr("k1 k2 k3 k4 of cv::fisheye")) << words[0];
    EXPECT_THAT(outcome.out, HasSubstr("say which lens it is: c.yml:fisheye, or c.yml:brown")) << words[0];
  }
  const Outcome chosen = alidade({"show", "c.yml:fisheye"});
  EXPECT_THAT(chosen.out, HasSubstr("kannala_brandt"));
  EXPECT_THAT(chosen.out, Not(HasSubstr("say which lens")));
  for (const std::string& camera : {std::string("c.yml"), std::string("c.yml:fisheye")}) {  // named by rig.yaml
    write_file(folder.path() / "rig.yaml", "heads:\n- camera: " + camera + "\n");
    const Outcome outcome = alidade::testing::run_program(
        {ALIDADE_EXECUTABLE, "project", "--rig", "rig.yaml", "--pan", "0", "--tilt", "0", "--point", "0", "0", "2"},
        folder.path().string());
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_EQ(outcome.out.find("say which lens it is") != std::string::npos, camera == "c.yml") << outcome.out;
  }
}

TEST_F(CameraCommand, ConvertSaysWhatOfTheFileIsNotInTheOther) {
  write_file(folder.path() / "a.cameramodel",
             "{'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': [90, 90, 80, 60], 'imagersize': [160, 120],\n"
             " 'extrinsics': [0, 0, 0, 0.1, 0, 0]}");
  for (const char* format : {"mrcal", "alidade"}) {
    const Outcome outcome = alidade({"convert", "a.cameramodel", "b", "--to", format});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_THAT(outcome.out, HasSubstr("not carried over from a.cameramodel: the extrinsics\n")) << format;
    const auto document =
        nlohmann::json::parse(alidade({"convert", "a.cameramodel", "b", "--to", format, "--json"}).out);
    EXPECT_EQ(document["estimate"]["left_out"], nlohmann::json({"the extrinsics"})) << format;
    EXPECT_EQ(document["verdict"]["exit_code"], 0);
  }
  EXPECT_THAT(alidade({"convert", "b", "c", "--to", "mrcal"}).out, Not(HasSubstr("not carried over")));
}

TEST_F(CameraCommand, ConvertNamesWhatIsWrong) {
  write("a.yaml", brown_camera());
  std::filesystem::create_directory(folder.path() / "folder");
  EXPECT_EQ(alidade({"convert", "a.yaml", "b.yaml", "--to", "bouguet"}).code, 2);
  EXPECT_EQ(alidade({"convert", "a.yaml"}).code, 2);
  EXPECT_THAT(alidade({"convert", "none.yaml", "b.yaml"}).err, HasSubstr("none.yaml"));
  EXPECT_THAT(alidade({"convert", "a.yaml", "folder"}).err, HasSubstr("folder: is a folder"));
  EXPECT_THAT(alidade({"convert", "a.yaml", "./a.yaml"}).err, HasSubstr("is the source itself"));
  EXPECT_EQ(alidade({"convert", "a.yaml", "/dev/null/b.yaml"}).code, 3);
}

TEST_F(CameraCommand, DiffSaysHowFarApartAndLeavesResults) {
  Camera b = brown_camera();
  std::get<Calibrated<Brown>>(b.lens).params[5] += 0.05;
  write("a.yaml", brown_camera());
  write("b.yaml", b);
  const Outcome outcome = alidade({"diff", "a.yaml", "b.yaml", "--out", "out"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("px RMS apart over the image"));
  EXPECT_THAT(outcome.out, HasSubstr("(35.4σ)"));  // 0.05 / (√2 · 0.001)
  const auto document = result("out");
  EXPECT_EQ(document["command"], "camera diff");
  EXPECT_EQ(document["verdict"]["state"], "care") << "that they differ is an answer, and it stands";
  EXPECT_EQ(document["verdict"]["checks"][0]["state"], "bad");
  EXPECT_EQ(document["data"]["parameters"]["name"][5], "k1");
  EXPECT_EQ(document["data"]["parameters"]["b"][5], -0.2);
  EXPECT_EQ(document["data"]["parameters"]["sigma_a"][5], 0.001);
  const auto& grid = document["grids"]["diff"];
  const std::size_t size = grid["cols"].get<std::size_t>() * grid["rows"].get<std::size_t>();
  for (const char* name : {"delta_u_px", "delta_v_px", "sigma_a_px", "sigma_b_px"}) EXPECT_EQ(grid[name].size(), size);
  // The sentence's number is that of the grid.
  double sum = 0.0;
  for (std::size_t i = 0; i < size; ++i) {
    sum += std::pow(grid["delta_u_px"][i].get<double>(), 2) + std::pow(grid["delta_v_px"][i].get<double>(), 2);
  }
  EXPECT_NEAR(document["estimate"]["rms_px"], std::sqrt(sum / double(size)), 1e-3);
  EXPECT_TRUE(exists("out/report.html"));
}

TEST_F(CameraCommand, DiffAcrossFormatsIsNothingForOneCamera) {
  write("a.yaml", brown_camera());
  write("b.cameramodel", brown_camera(), CameraFormat::mrcal);
  const Outcome outcome = alidade({"diff", "a.yaml", "b.cameramodel", "--distance", "2", "--json", "--out", "out"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  const auto document = nlohmann::json::parse(outcome.out);
  EXPECT_LT(document["estimate"]["max_px"], 1e-6);
  EXPECT_EQ(document["verdict"]["state"], "good");
  EXPECT_TRUE(document["grids"]["diff"]["sigma_b_px"][0].is_null()) << "a .cameramodel of ours has no covariance";
}

TEST_F(CameraCommand, DiffRefusesCamerasThatCannotBeCompared) {
  Camera b = brown_camera();
  b.width_px = 320;
  write("a.yaml", brown_camera());
  write("b.yaml", b);
  const Outcome sizes = alidade({"diff", "a.yaml", "b.yaml"});
  EXPECT_EQ(sizes.code, 3);
  EXPECT_THAT(sizes.err, HasSubstr("b.yaml is 320 × 120 px"));
  b = brown_camera();
  std::get<Calibrated<Brown>>(b.lens).params[5] = -1e9;
  write("b.yaml", b);
  const Outcome blind = alidade({"diff", "a.yaml", "b.yaml"});
  EXPECT_EQ(blind.code, 4);
  EXPECT_THAT(blind.err, HasSubstr("see nothing in common"));
  EXPECT_EQ(alidade({"diff", "a.yaml", "b.yaml", "--distance", "0"}).code, 2);
}

/// A photo, by `camera`, of a far wall whose brightness is a smooth function of the direction.
cv::Mat photo_of_wall(const Camera& camera) {
  cv::Mat photo(camera.height_px, camera.width_px, CV_16U, cv::Scalar(0));
  for (int v = 0; v < photo.rows; ++v) {
    for (int u = 0; u < photo.cols; ++u) {
      const auto ray = unproject(camera, Eigen::Vector2d(u, v));
      if (!ray) continue;
      const double x = ray->x() / ray->z(), y = ray->y() / ray->z();
      photo.at<std::uint16_t>(v, u) =
          static_cast<std::uint16_t>(30000.0 + 20000.0 * std::sin(12.0 * x) * std::cos(9.0 * y));
    }
  }
  return photo;
}

TEST_F(CameraCommand, UndistortGivesThePhotoThatAPinholeWouldHaveTaken) {
  const Camera camera = brown_camera();
  write("a.yaml", camera);
  cv::imwrite((folder.path() / "left.tiff").string(), photo_of_wall(camera));
  const Outcome outcome = alidade({"undistort", "a.yaml", "left.tiff", "--out", "out"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Camera straight = read_camera(folder.path() / "out/camera.yaml");
  EXPECT_EQ(model_name(straight.lens), "pinhole");
  const cv::Mat got = cv::imread((folder.path() / "out/left.png").string(), cv::IMREAD_UNCHANGED);
  const cv::Mat expected = photo_of_wall(straight);
  ASSERT_EQ(got.type(), CV_16U);
  ASSERT_EQ(got.size(), expected.size());
  int compared = 0;
  for (int v = 2; v + 2 < got.rows; ++v) {
    for (int u = 2; u + 2 < got.cols; ++u, ++compared) {
      // OpenCV rounds the map to 1/32 px: 1/64 px times a slope of 2000 grey levels a px, and as much for interpolation
      EXPECT_NEAR(got.at<std::uint16_t>(v, u), expected.at<std::uint16_t>(v, u), 100) << u << ' ' << v;
    }
  }
  EXPECT_EQ(compared, 156 * 116);
}

/// A folder's contents: names and bytes.
std::map<std::string, std::string> contents(const std::filesystem::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    files[entry.path().filename().string()] = read_file(entry.path());
  }
  return files;
}

TEST_F(CameraCommand, UndistortInterruptedLeavesWhatWasThere) {
  Camera camera = brown_camera();
  camera.width_px = 2000;
  camera.height_px = 1500;
  write("a.yaml", camera);
  cv::imwrite((folder.path() / "0.png").string(), cv::Mat(1500, 2000, CV_8U, cv::Scalar(7)));
  ASSERT_EQ(alidade({"undistort", "a.yaml", "0.png", "--out", "out"}).code, 0);
  const auto before = contents(folder.path() / "out");
  cv::imwrite((folder.path() / "0.png").string(), cv::Mat(1500, 2000, CV_8U, cv::Scalar(9)));
  std::vector<std::string> words{ALIDADE_EXECUTABLE, "camera", "undistort", "a.yaml", "0.png"};
  for (int i = 1; i < 100; ++i) {  // one image that is quick to read, many times: 0.4 s to read, 10 times that to remap
    words.push_back(std::to_string(i) + ".png");
    std::filesystem::create_hard_link(folder.path() / "0.png", folder.path() / words.back());
  }
  words.insert(words.end(), {"--out", "out", "--threads", "1"});
  const Outcome outcome = alidade::testing::run_program(
      words, folder.path().string(), alidade::testing::interrupt_after(std::chrono::milliseconds(1700)));
  EXPECT_EQ(outcome.code, 130);
  EXPECT_EQ(outcome.err, "alidade: error: interrupted; nothing written\n");
  EXPECT_TRUE(contents(folder.path() / "out") == before);
}

TEST_F(CameraCommand, UndistortAgainIntoTheSameFolderLeavesTheImages) {
  write("a.yaml", brown_camera());
  for (const char* name : {"b.png", "a.png", "c.png"}) {
    cv::imwrite((folder.path() / name).string(), photo_of_wall(brown_camera()));
  }
  for (int time = 0; time < 2; ++time) {
    ASSERT_EQ(alidade({"undistort", "a.yaml", "b.png", "a.png", "c.png", "--out", "out"}).code, 0);
    for (const char* name : {"a.png", "b.png", "c.png"}) EXPECT_TRUE(exists(std::string("out/") + name)) << time;
  }
  EXPECT_EQ(result("out")["files"], nlohmann::json({"b.png", "a.png", "c.png", "camera.yaml"}));
}

TEST_F(CameraCommand, UndistortRefusesByNameAndLeavesNothing) {
  const Camera camera = brown_camera();
  write("a.yaml", camera);
  cv::imwrite((folder.path() / "good.png").string(), photo_of_wall(camera));
  cv::imwrite((folder.path() / "small.png").string(), cv::Mat(60, 80, CV_8U, cv::Scalar(7)));
  write_file(folder.path() / "text.jpg", "not a photo");
  write_file(folder.path() / "empty.jpg", "");
  const std::pair<const char*, const char*> cases[] = {
      {"small.png", "small.png: is 80 × 60 px, but the camera is 160 × 120"},
      {"text.jpg", "text.jpg: is not a photo"},
      {"empty.jpg", "empty.jpg: is not a photo"},
      {"none.jpg", "none.jpg"},
      {"good.png", "good.png: another photo gives good.png too"}};
  for (const auto& [photo, message] : cases) {
    const Outcome outcome = alidade({"undistort", "a.yaml", "good.png", photo, "--out", "out"});
    EXPECT_EQ(outcome.code, 3) << photo;
    EXPECT_THAT(outcome.err, HasSubstr(message));
    EXPECT_FALSE(exists("out")) << photo;
  }
  EXPECT_THAT(alidade({"undistort", "a.yaml", "good.png", "--out", "."}).err, HasSubstr("would be replaced"));
}

}  // namespace
}  // namespace alidade::cli
