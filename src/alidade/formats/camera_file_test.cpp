#include "alidade/formats/camera_file.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "alidade/testing/fault.h"
#include "alidade/testing/random.h"
#include "alidade/testing/temporary_folder.h"

namespace alidade {
namespace {

using testing::fault_of;
using ::testing::HasSubstr;

constexpr CameraFormat all_formats[] = {CameraFormat::alidade, CameraFormat::opencv, CameraFormat::ros,
                                        CameraFormat::kalibr,  CameraFormat::mrcal,  CameraFormat::colmap};

/// A lens with numbers that have no short decimal form.
Lens random_lens(std::string_view model, std::mt19937_64& rng) {
  std::uniform_real_distribution<> unit(-1.0, 1.0);
  Lens lens = *make_lens(model);
  Eigen::VectorXd values = 0.1 * Eigen::VectorXd::NullaryExpr(params(lens).size(), [&] { return unit(rng); });
  values.head<4>() << 700.0 + 300.0 * unit(rng), 700.0 + 300.0 * unit(rng), 512.0 + unit(rng), 384.0 * unit(rng);
  values[4] = 0.0;
  return with_params(lens, values);
}

bool can_hold(CameraFormat format, const Camera& camera) {
  const bool is_fisheye = model_name(camera.lens) == "kannala_brandt";
  return !(format == CameraFormat::mrcal && is_fisheye);
}

TEST(CameraFile, RoundTripsAreExactInEveryFormat) {
  auto rng = testing::make_rng();
  int checked = 0;
  for (const CameraFormat format : all_formats) {
    for (const char* model : {"pinhole", "brown", "kannala_brandt"}) {
      for (int i = 0; i < 200; ++i) {
        Camera camera{1920, 1080, random_lens(model, rng), {}, 0.0, {}};
        if (!can_hold(format, camera)) continue;
        auto* brown = std::get_if<Calibrated<Brown>>(&camera.lens);
        if (format == CameraFormat::kalibr && brown) brown->params[9] = 0.0;  // k3, which Kalibr does not have
        const Camera back = parse_camera(camera_text(camera, format), "file");
        const Eigen::VectorXd expected = params(camera.lens);
        EXPECT_EQ(model_name(back.lens), model) << camera_format_name(format);
        EXPECT_EQ(params(back.lens), expected) << camera_format_name(format);
        EXPECT_EQ(back.width_px, 1920);
        EXPECT_EQ(back.height_px, 1080);
        ++checked;
      }
    }
  }
  EXPECT_EQ(checked, (6 * 3 - 1) * 200);
}

TEST(CameraFile, OursKeepsEverything) {
  auto rng = testing::make_rng();
  std::normal_distribution<> standard;
  Camera camera{640, 480, random_lens("brown", rng), {}, 0.123456789012345, "13 photos \"left\" \\ #1: a"};
  std::get<Calibrated<Brown>>(camera.lens).params[4] = -0.7;
  const Eigen::MatrixXd root = Eigen::MatrixXd::NullaryExpr(10, 10, [&] { return standard(rng); });
  camera.cov = root * root.transpose();
  camera.cov.row(4).setZero(), camera.cov.col(4).setZero();  // a fixed parameter
  camera.cov = camera.cov.selfadjointView<Eigen::Upper>();
  const Camera back = parse_camera(camera_text(camera, CameraFormat::alidade), "file");
  EXPECT_EQ(params(back.lens), params(camera.lens));
  EXPECT_EQ(back.cov, camera.cov);
  EXPECT_EQ(back.rms_px, camera.rms_px);
  EXPECT_EQ(back.source, camera.source);
}

TEST(CameraFile, KeysAreThoseOfTheContract) {
  const Camera camera{640, 480, Calibrated<Brown>{Params<Brown>{1, 2, 3, 4, 5, 6, 7, 8, 9, 10}}, {}, 0.5, "here"};
  EXPECT_EQ(camera_text(camera, CameraFormat::alidade),
            "model: brown\nwidth: 640\nheight: 480\nfx: 1.0\nfy: 2.0\ncx: 3.0\ncy: 4.0\nskew: 5.0\nk1: 6.0\nk2: 7.0\n"
            "p1: 8.0\np2: 9.0\nk3: 10.0\nrms_px: 0.5\nsource: \"here\"\n");
}

TEST(CameraFile, ACovarianceMayNameSomeParameters) {
  const Camera camera = parse_camera(
      "model: pinhole\nwidth: 640\nheight: 480\nfx: 500\nfy: 501\ncx: 320\ncy: 240\n"
      "covariance: {names: [cy, fx], upper: [4, 1, 9]}\n",
      "file");
  EXPECT_EQ(camera.cov(3, 3), 4.0);
  EXPECT_EQ(camera.cov(0, 3), 1.0);
  EXPECT_EQ(camera.cov(3, 0), 1.0);
  EXPECT_EQ(camera.cov(0, 0), 9.0);
  EXPECT_EQ(camera.cov.cwiseAbs().sum(), 15.0);
}

// --- what a format cannot store -------------------------------------------------------------------------------------

TEST(CameraFile, WhatWouldBeLostIsSaidAndRefused) {
  Camera camera{640, 480, Calibrated<Brown>{Params<Brown>{500, 500, 320, 240, 0, 0.1, 0, 0, 0, 0.25}}, {}, 0.0, {}};
  EXPECT_EQ(fault_of([&] { (void)camera_text(camera, CameraFormat::kalibr); }),
            "the format kalibr cannot hold k3 0.25; --lossy writes the nearest without");
  std::get<Calibrated<Brown>>(camera.lens).params[4] = 0.3;
  for (const CameraFormat format : all_formats) {
    if (format == CameraFormat::alidade) continue;
    EXPECT_THAT(fault_of([&] { (void)camera_text(camera, format); }), HasSubstr("cannot hold skew 0.3 px"));
    EXPECT_EQ(params(parse_camera(camera_text(camera, format, true), "f").lens)[4], 0.0);
  }
  camera.lens = Calibrated<KannalaBrandt>{Params<KannalaBrandt>{500, 500, 320, 240, 0, 0.1, 0, 0, 0}};
  EXPECT_THAT(fault_of([&] { (void)camera_text(camera, CameraFormat::mrcal, true); }), HasSubstr("mrcal has no lens"));
  camera.cov = Eigen::MatrixXd::Identity(9, 9);
  EXPECT_THAT(other_losses(camera, CameraFormat::ros), ::testing::ElementsAre("the covariance"));
  EXPECT_TRUE(other_losses(camera, CameraFormat::alidade).empty());
}

// --- files as others write them -------------------------------------------------------------------------------------

TEST(CameraFile, ReadsWhatOthersWrite) {
  const struct {
    const char* what;
    std::string text;
    std::string model;
    std::vector<double> values;
  } files[] = {
      {"OpenCV's calibration sample",
       "%YAML:1.0\n---\ncalibration_time: \"Sat\"\nimage_width: 640\nimage_height: 480\nflags: 0\n"
       "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 500., 0., 320., 0., 501.,\n"
       "       240., 0., 0., 1. ]\ndistortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n"
       "   data: [ 1.0e-01, 2.0e-01, 3.0e-03, 4.0e-03, 5.0e-01 ]\n",
       "brown",
       {500, 501, 320, 240, 0, 0.1, 0.2, 0.003, 0.004, 0.5}},
      {"OpenCV, eight coefficients of which three are zero",
       "%YAML:1.0\nimage_width: 640\nimage_height: 480\ncamera_matrix: {rows: 3, cols: 3, data: "
       "[500,0,320,0,501,240,0,0,1]}\n"
       "distortion_coefficients: {rows: 1, cols: 8, data: [0.1,0.2,0,0,0.5,0,0,0]}\n",
       "brown",
       {500, 501, 320, 240, 0, 0.1, 0.2, 0, 0, 0.5}},
      {"OpenCV's XML",
       "<?xml version=\"1.0\"?>\n<opencv_storage>\n<image_width>640</image_width><image_height>480</image_height>\n"
       "<camera_matrix type_id=\"opencv-matrix\"><rows>3</rows><cols>3</cols><dt>d</dt>"
       "<data>500. 0. 320. 0. 501. 240. 0. 0. 1.</data></camera_matrix>\n"
       "<distortion_coefficients type_id=\"opencv-matrix\"><rows>4</rows><cols>1</cols><dt>d</dt>"
       "<data>1.0e-01 0.2 0. 0.</data></distortion_coefficients><fisheye_model>1</fisheye_model></opencv_storage>\n",
       "kannala_brandt",
       {500, 501, 320, 240, 0, 0.1, 0.2, 0, 0}},
      {"OpenCV's JSON",
       "{\"image_width\": 640, \"image_height\": 480, \"camera_matrix\": {\"type_id\": \"opencv-matrix\", \"rows\": 3, "
       "\"cols\": 3, \"dt\": \"d\", \"data\": [500.0, 0.0, 320.0, 0.0, 501.0, 240.0, 0.0, 0.0, 1.0]}, "
       "\"distortion_coefficients\": {\"type_id\": \"opencv-matrix\", \"rows\": 1, \"cols\": 4, \"dt\": \"d\", "
       "\"data\": [0.1, 0.2, 0.0, 0.0]}}",
       "brown",
       {500, 501, 320, 240, 0, 0.1, 0.2, 0, 0, 0}},
      {"a ROS 1 message as printed",
       "header:\n  seq: 0\nheight: 480\nwidth: 640\ndistortion_model: \"plumb_bob\"\nD: [0.1, 0.2, 0.0, 0.0, 0.5]\n"
       "K: [500.0, 0.0, 320.0, 0.0, 501.0, 240.0, 0.0, 0.0, 1.0]\nR: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]\n",
       "brown",
       {500, 501, 320, 240, 0, 0.1, 0.2, 0, 0, 0.5}},
      {"a ROS fisheye",
       "image_width: 640\nimage_height: 480\ncamera_name: x\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
       "  data: [500, 0, 320, 0, 501, 240, 0, 0, 1]\ndistortion_model: equidistant\ndistortion_coefficients:\n  rows: "
       "1\n"
       "  cols: 4\n  data: [0.1, 0.2, 0.3, 0.4]\n",
       "kannala_brandt",
       {500, 501, 320, 240, 0, 0.1, 0.2, 0.3, 0.4}},
      {"Kalibr",
       "cam0:\n  cam_overlaps: []\n  camera_model: pinhole\n  distortion_coeffs: [0.1, 0.2, 0.003, 0.004]\n"
       "  distortion_model: radtan\n  intrinsics: [500, 501, 320, 240]\n  resolution: [640, 480]\n  rostopic: /a\n",
       "brown",
       {500, 501, 320, 240, 0, 0.1, 0.2, 0.003, 0.004, 0}},
      {"mrcal, with what a solve leaves in it",
       "# generated\n{\n    'lensmodel':  'LENSMODEL_OPENCV8',\n\n    # intrinsics are fx,fy\n    'intrinsics': [ 500, "
       "501, "
       "320, 240, 0.1, 0.2, 0, 0, 0.5, 0, 0, 0,],\n    # region: ] } '\n    'valid_intrinsics_region': [ [ 1, 2 ], [ "
       "3, 4 "
       "],],\n    'extrinsics': [ 0, 0, 0, 1, 0, 0,],\n    'imagersize': [ 640, 480,],\n    'icam_intrinsics': 0,\n"
       "    'optimization_inputs': b'P){(+&[x}:,#',\n}\n",
       "brown",
       {500, 501, 320, 240, 0, 0.1, 0.2, 0, 0, 0.5}},
      {"COLMAP",
       "# Camera list\n# Number of cameras: 1\n1 SIMPLE_RADIAL 640 480 500 320.5 240.5 0.1\n",
       "brown",
       {500, 500, 320, 240, 0, 0.1, 0, 0, 0, 0}},
      {"COLMAP's fisheye with commas",
       "7,OPENCV_FISHEYE,640,480,500,501,320.5,240.5,0.1,0.2,0.3,0.4\r\n",
       "kannala_brandt",
       {500, 501, 320, 240, 0, 0.1, 0.2, 0.3, 0.4}},
  };
  for (const auto& file : files) {
    SCOPED_TRACE(file.what);
    const Camera camera = parse_camera(file.text, "file");
    EXPECT_EQ(model_name(camera.lens), file.model);
    EXPECT_EQ(params(camera.lens),
              Eigen::Map<const Eigen::VectorXd>(file.values.data(), Eigen::Index(file.values.size())));
    EXPECT_EQ(camera.width_px, 640);
    EXPECT_EQ(camera.height_px, 480);
  }
}

TEST(CameraFile, OneOfSeveralCamerasIsChosenByName) {
  const testing::TemporaryFolder folder;
  const std::filesystem::path chain = folder.path() / "chain.yaml", list = folder.path() / "cameras.txt";
  const auto cam = [](const char* name, int focal) {
    return fmt::format(
        "{}:\n  camera_model: pinhole\n  distortion_model: none\n  distortion_coeffs: []\n"
        "  intrinsics: [{}, {}, 320, 240]\n  resolution: [640, 480]\n",
        name, focal, focal);
  };
  write_file(chain, cam("cam0", 500) + cam("cam1", 600));
  write_file(list, "3 PINHOLE 640 480 500 500 320.5 240.5\n5 PINHOLE 640 480 600 600 320.5 240.5\n");
  EXPECT_EQ(params(read_camera(chain.string() + ":cam1").lens)[0], 600.0);
  EXPECT_EQ(params(read_camera(list.string() + ":3").lens)[0], 500.0);
  EXPECT_EQ(fault_of([&] { (void)read_camera(chain); }),
            chain.string() + ": holds 2 cameras (cam0, cam1); choose one: " + chain.string() + ":cam0");
  EXPECT_THAT(fault_of([&] { (void)read_camera(list.string() + ":4"); }), HasSubstr("has no camera '4'; it has 3, 5"));
  write_file(chain, camera_text({640, 480, Calibrated<Pinhole>{{1, 1, 1, 1, 0}}, {}, 0, {}}, CameraFormat::alidade));
  EXPECT_THAT(fault_of([&] { (void)read_camera(chain.string() + ":cam1"); }), HasSubstr("holds one camera"));
}

TEST(CameraFile, WhatIsNotReadIsNamed) {
  const testing::TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "f";
  const auto unread = [&](const std::string& text, const std::string& choice = "") {
    write_file(file, text);
    return fmt::format("{}", fmt::join(unread_parts(file.string() + choice), "; "));
  };
  const std::string mrcal = "{'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': [1,1,3,4], 'imagersize': [640,480]";
  EXPECT_EQ(unread(mrcal + "}"), "");
  EXPECT_EQ(unread(mrcal + ", 'extrinsics': [0, 0.0, -0, 0e5, 0, 0]}"), "");
  EXPECT_EQ(unread(mrcal + ", 'extrinsics': [0, 0, 0, 0, 0, 1e-3]}"), "the extrinsics");
  EXPECT_EQ(unread(mrcal + ", 'extrinsics': [0, nan]}"), "the extrinsics") << "not read, so not refused either";

  const std::string cam =
      "  camera_model: pinhole\n  distortion_model: none\n  intrinsics: [500, 500, 320, 240]\n"
      "  resolution: [640, 480]\n";
  const std::string pose = "  T_cn_cnm1:\n  - [1, 0, 0, -0.1]\n  - [0, 1, 0, 0]\n  - [0, 0, 1, 0]\n  - [0, 0, 0, 1]\n";
  EXPECT_EQ(unread("cam0:\n" + cam), "");
  EXPECT_EQ(unread("cam0:\n" + cam + "cam1:\n" + cam + pose, ":cam1"),
            "T_cn_cnm1; that it is cam1 of 2 cameras (cam0, cam1)");
  EXPECT_EQ(unread("cam0:\n" + cam + "  T_cam_imu: [[1]]\n  timeshift_cam_imu: 0.01\n"),
            "T_cam_imu; timeshift_cam_imu");

  const auto ros = [&](const std::string& rectification, const std::string& projection) {
    return unread(
        "image_width: 640\nimage_height: 480\ncamera_matrix: {rows: 3, cols: 3, data: [500,0,320,0,500,240,0,0,1]}\n"
        "distortion_model: plumb_bob\ndistortion_coefficients: {rows: 1, cols: 5, data: [0,0,0,0,0]}\n" +
        rectification + projection);
  };
  const std::string straight = "rectification_matrix: {rows: 3, cols: 3, data: [1,0,0,0,1,0,0,0,1]}\n";
  const std::string turned = "R: [1,0,0.001,0,1,0,-0.001,0,1]\n";
  EXPECT_EQ(ros("", ""), "");
  EXPECT_EQ(ros(straight, "projection_matrix: {rows: 3, cols: 4, data: [490,0,321,0,0,490,241,0,0,0,1,0]}\n"), "");
  EXPECT_EQ(ros(straight, "P: [490,0,321,-49,0,490,241,0,0,0,1,0]\n"), "the baseline in the projection matrix P");
  EXPECT_EQ(ros(straight, "p: [490,0,321,0,0,490,241,-49,0,0,1,0]\n"), "the baseline in the projection matrix P");
  EXPECT_EQ(ros(turned, ""), "the rectification matrix R");
  const std::string whole = "binning_x: 0\nbinning_y: 1\nroi: {x_offset: 0, y_offset: 0, height: 0, width: 0}\n";
  EXPECT_EQ(ros(straight, whole), "");
  EXPECT_EQ(ros(straight, "roi: {x_offset: 0, y_offset: 0, height: 480, width: 640, do_rectify: false}\n"), "");
  EXPECT_EQ(ros(straight, "binning_x: 2\nbinning_y: 2\nroi: none\n"),
            "the binning (the lens is that of full resolution)");
  EXPECT_EQ(ros(straight, "roi: {x_offset: 100, y_offset: 0, height: 240, width: 320}\n"),
            "the region of interest roi (the lens is that of the whole image)");
  EXPECT_EQ(ros("R: [1,0]\n", "P: none\n"), "the rectification matrix R") << "not read, so not refused either";

  EXPECT_EQ(unread("3 PINHOLE 640 480 500 500 320 240\n5 PINHOLE 640 480 600 600 320 240\n", ":5"),
            "that it is 5 of 2 cameras (3, 5)");
  EXPECT_THAT(
      fault_of([&] { (void)unread("5 PINHOLE 640 480 500 500 320 240\n5 PINHOLE 640 480 600 600 320 240\n", ":5"); }),
      HasSubstr("has more than one camera '5'"));
  EXPECT_EQ(unread(camera_text(parse_camera("1 PINHOLE 64 48 50 50 32 24", "f"), CameraFormat::alidade)), "");
}

// --- files that are wrong -------------------------------------------------------------------------------------------

std::string ours(const std::string& from, const std::string& to) {
  std::string text = "model: pinhole\nwidth: 640\nheight: 480\nfx: 500\nfy: 501\ncx: 320\ncy: 240\nskew: 0\n";
  if (!from.empty()) text.replace(text.find(from), from.size(), to);
  return text;
}

TEST(CameraFile, AWrongFileIsOneLineThatNamesTheKey) {
  const std::string opencv_head = "image_width: 640\nimage_height: 480\ncamera_matrix: {rows: 3, cols: 3, data: ";
  const std::string no_distortion = "}\ndistortion_coefficients: {rows: 1, cols: 4, data: [0,0,0,0]}\n";
  const std::pair<std::string, std::string> cases[] = {
      {"", "f: is empty"},
      {"# only this\n", "f: is empty"},
      {std::string("\x89PNG\0\1", 6), "f: is not text"},
      {"hello", "f: is not a camera file of"},
      {"{]", "f:1: is not YAML"},
      {"a: [1, 2", "is not YAML"},
      {std::string(100000, '['), "is not YAML"},
      {std::string(100000, '{') + "lensmodel", "f:1:"},
      {ours("fx: 500", "fx: nan"), "f: fx: 'nan' is not a finite number"},
      {ours("fx: 500", "fx: .inf"), "f: fx: '.inf' is not a finite number"},
      {ours("fx: 500", "fx: 1e300"), "f: fx: 1e300 is beyond 1e12"},
      {ours("fx: 500", "fx: 1e999"), "f: fx: '1e999' is not a finite number"},
      {ours("fx: 500", "fx: -500"), "f: fx: is not above zero"},
      {ours("fx: 500", "fx: 0"), "f: fx: is not above zero"},
      {ours("fx: 500", "fx: [500]"), "f: fx: is not a single value"},
      {ours("fx: 500\n", ""), "f: fx: is missing"},
      {ours("fx: 500\n", "fx:\n"), "f: fx: is missing"},
      {ours("fx: 500", "fx: 500\nfx: 501"), "f: fx: appears twice"},
      {ours("fx: 500", "fx: 500 px"), "f: fx: '500 px' is not a finite number"},
      {ours("skew", "k1"), "f: k1: is not a key of this model; known: model width"},
      {ours("pinhole", "dome_port"), "f: model: 'dome_port' is not known"},
      {ours("width: 640", "width: 640.5"), "f: width: 640.5 is not an image's size"},
      {ours("width: 640", "width: -1"), "f: width: -1 is not an image's size"},
      {ours("width: 640", "width: 99999999999"), "is not an image's size"},
      {ours("", "") + "rms_px: -1\n", "f: rms_px: is below zero"},
      {ours("", "") + "covariance: {names: [fx], upper: [1, 2]}\n", "f: covariance.upper: 2 numbers are not"},
      {ours("", "") + "covariance: {names: [fx, k1], upper: [1, 0, 2]}\n",
       "f: covariance.names: 'k1' is no parameter of the model; it has fx, fy, cx, cy"},
      {ours("", "") + "covariance: {names: [fx, fx], upper: [1, 0, 2]}\n", "f: covariance.names: 'fx' appears twice"},
      {ours("", "") + "covariance: {names: [fx, fy], upper: [1, 2, 1]}\n", "fx and fy cannot vary together like that"},
      {ours("", "") + "covariance: {names: [fx], upper: [-1]}\n", "not a covariance"},
      {opencv_head + "[500,0,320,0,500,240,0,0" + "]" + no_distortion,
       "f: camera_matrix: 8 numbers are not 3 rows of 3"},
      {opencv_head + "[500,0.3,320,0,500,240,0,0,1]" + no_distortion, "f: camera_matrix: a skew of 0.3 px"},
      {opencv_head + "[500,0,320,0,500,240,0,0,2]" + no_distortion, "f: camera_matrix: is not a camera matrix"},
      {opencv_head + "[-500,0,320,0,500,240,0,0,1]" + no_distortion, "f: fx: -500 is not above zero"},
      {opencv_head + "[500,0,320,0,500,240,0,0,1]}\n", "f: distortion_coefficients: is missing"},
      {opencv_head + "[500,0,320,0,500,240,0,0,1]}\ndistortion_coefficients: [1,2,3]\n", "3 coefficients; OpenCV has"},
      {opencv_head + "[500,0,320,0,500,240,0,0,1]}\ndistortion_coefficients: [0,0,0,0,0,0.5,0,0]\n",
       "f: distortion_coefficients: k4 is 0.5: a rational lens is no model of ours"},
      {opencv_head + "[500,0,320,0,500,240,0,0,1]}\ndistortion_coefficients: [0,0,0,0,0,0,0,0,0.5,0,0,0]\n",
       "thin prism"},
      {opencv_head + "[500,0,320,0,500,240,0,0,1]}\ndistortion_model: fov\nD: [1]\n", "f: distortion_model: 'fov'"},
      {"<?xml version=\"1.0\"?><opencv_storage><camera_matrix", "f: is XML, but not a file of OpenCV"},
      {"<?xml version=\"1.0\"?><a/>", "f: "},
      {"cam0: {camera_model: omni, intrinsics: [1,2,3,4,5]}", "f: cam0.camera_model: 'omni' is no model of ours"},
      {"cam0: {camera_model: pinhole, intrinsics: [1,2,3]}", "f: cam0.intrinsics: is not [fx, fy, cx, cy]"},
      {"{'lensmodel': 'LENSMODEL_CAHVOR', 'intrinsics': []}", "f: lensmodel: 'LENSMODEL_CAHVOR' is no model of ours"},
      {"{'lensmodel': 'LENSMODEL_SPLINED_STEREOGRAPHIC_order=3'}", "is no model of ours"},
      {"{'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': [1,2,3]}",
       "f: intrinsics: 3 numbers; LENSMODEL_PINHOLE has 4"},
      {"{'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': [1,2,", "f:1: "},
      {"{\n'lensmodel': 'LENSM", "f:2: a quotation has no end"},
      {"{\n'lensmodel': # in a comment '", "f:2: a value is missing"},
      {"{ 'lensmodel'", "f:1: ':' is missing"},
      {"{ 'lensmodel': b", "f:1: ',' or '}' is missing"},
      {"{'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': [1,1,3,4]}", "f: imagersize: is missing"},
      {"1 FOV 640 480 500 500 320 240 0.9", "f:1: MODEL: 'FOV' is no model of ours"},
      {"1 PINHOLE 640 480 500 500 320", "f:1: PARAMS: 3 numbers; PINHOLE has 4"},
      {"1 PINHOLE 640", "f:1: is not CAMERA_ID"},
      {"1 PINHOLE 640 480 500 nan 320 240", "f:1: fy: 'nan' is not a finite number"},
      {"1 FULL_OPENCV 640 480 500 500 320 240 0 0 0 0 0 0.1 0 0", "f:1: PARAMS: k4 is 0.1: a rational lens"},
  };
  for (const auto& [text, expected] : cases) {
    const std::string fault = fault_of([&from = text] { (void)parse_camera(from, "f"); });
    EXPECT_THAT(fault, HasSubstr(expected)) << text.substr(0, 200);
    EXPECT_EQ(fault.find('\n'), std::string::npos) << fault;
  }
}

TEST(CameraFile, ATruncatedFileNeverGivesACamera) {
  auto rng = testing::make_rng();
  const Camera camera{640, 480, random_lens("brown", rng), Eigen::MatrixXd::Identity(10, 10), 0.2, "x"};
  for (const CameraFormat format : all_formats) {
    const std::string text = camera_text(camera, format, true);
    const Camera whole = parse_camera(text, "f");
    for (std::size_t length = 0; length + 1 < text.size(); ++length) {
      try {
        // A cut inside the last number or of the optional entries at the end is a file like any other: what is read
        // must then be complete, as far as it goes.
        const Camera cut = parse_camera(text.substr(0, length), "f");
        EXPECT_EQ(params(cut.lens).head<8>(), params(whole.lens).head<8>()) << camera_format_name(format) << length;
      } catch (const InputError&) {
      }
    }
  }
}

TEST(CameraFile, AFileThatIsNotThereIsNamed) {
  EXPECT_THAT(fault_of([] { (void)read_camera("/no/such/camera.yaml"); }), HasSubstr("/no/such/camera.yaml"));
  EXPECT_THAT(fault_of([] { (void)read_camera("/no/such/camera.yaml:cam0"); }), HasSubstr("/no/such/camera.yaml:cam0"));
}

TEST(CameraFormatName, IsKnownOrNamed) {
  for (const CameraFormat format : all_formats) EXPECT_EQ(camera_format(camera_format_name(format)), format);
  EXPECT_EQ(fault_of([] { (void)camera_format("bouguet"); }),
            "'bouguet' is no camera format; known: alidade, opencv, ros, kalibr, mrcal, colmap");
}

}  // namespace
}  // namespace alidade
