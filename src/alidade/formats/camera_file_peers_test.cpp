#include <fmt/format.h>
#include <gtest/gtest.h>

#include <sstream>

#include "alidade/formats/camera_file.h"
#include "alidade/testing/process.h"
#include "alidade/testing/random.h"
#include "alidade/testing/temporary_folder.h"

namespace alidade {
namespace {

/// Projects points by what `python` (which defines project(file, points)) makes of our file, and compares to 1e-9 px.
void expect_their_projection(const Camera& camera, CameraFormat format, const std::string& module,
                             const std::string& python) {
  if (testing::run_program({"/usr/bin/python3", "-c", "import numpy, " + module}).code != 0) {
    GTEST_SKIP() << "Debian's python3 has no module " << module;
  }
  const testing::TemporaryFolder folder;
  write_file(folder.path() / "camera", camera_text(camera, format));
  auto rng = testing::make_rng();
  std::uniform_real_distribution<> unit(-1.0, 1.0);
  std::vector<Eigen::Vector3d> points_in_cam;
  std::string points;
  for (int i = 0; i < 300; ++i) {
    points_in_cam.emplace_back(0.5 * unit(rng), 0.5 * unit(rng), 1.0);
    points += fmt::format("{} {} {}\n", points_in_cam.back().x(), points_in_cam.back().y(), points_in_cam.back().z());
  }
  write_file(folder.path() / "points", points);
  write_file(folder.path() / "project.py", "import numpy, sys, " + module + "\n" + python +
                                               "\nfor px in project('camera', numpy.loadtxt('points')):\n"
                                               "    print(repr(float(px[0])), repr(float(px[1])))\n");
  const testing::Outcome outcome = testing::run_program({"/usr/bin/python3", "project.py"}, folder.path().string());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  std::istringstream lines(outcome.out);
  int checked = 0;
  for (double u = 0, v = 0; lines >> u >> v; ++checked) {
    const Eigen::Vector2d px = project(camera, points_in_cam.at(std::size_t(checked))).value();
    EXPECT_LT((px - Eigen::Vector2d(u, v)).norm(), 1e-9);
  }
  EXPECT_EQ(checked, 300);
}

Camera brown_camera() {
  return {1280, 960, Calibrated<Brown>{Params<Brown>{901.3, 905.7, 640.1, 470.9, 0, -0.25, 0.1, 0.001, -0.0005, -0.02}},
          {},   0.2, "test"};
}
Camera pinhole_camera() { return {1280, 960, Calibrated<Pinhole>{{900, 905, 640, 470, 0}}, {}, 0.0, {}}; }
Camera fisheye_camera() {
  return {1280,
          960,
          Calibrated<KannalaBrandt>{Params<KannalaBrandt>{501.3, 500.7, 640.1, 480.9, 0, -.02, .004, -.001, 1e-4}},
          {},
          0.0,
          {}};
}

const char* const opencv_python = R"(
def project(file, points):
    f = cv2.FileStorage(file, cv2.FILE_STORAGE_READ)
    K, k = f.getNode('camera_matrix').mat(), f.getNode('distortion_coefficients').mat()
    assert f.getNode('image_width').real() == 1280 and f.getNode('image_height').real() == 960
    if f.getNode('fisheye_model').isInt():
        return cv2.fisheye.projectPoints(points[:, None], numpy.zeros(3), numpy.zeros(3), K, k)[0][:, 0]
    return cv2.projectPoints(points, numpy.zeros(3), numpy.zeros(3), K, k)[0][:, 0]
)";
const char* const mrcal_python = R"(
def project(file, points):
    m = mrcal.cameramodel(file)
    assert tuple(m.imagersize()) == (1280, 960)
    return mrcal.project(points, *m.intrinsics())
)";

TEST(TheirReaders, OpenCvReadsABrownLens) {
  expect_their_projection(brown_camera(), CameraFormat::opencv, "cv2", opencv_python);
}
TEST(TheirReaders, OpenCvReadsAPinhole) {
  expect_their_projection(pinhole_camera(), CameraFormat::opencv, "cv2", opencv_python);
}
TEST(TheirReaders, OpenCvReadsAFisheye) {
  expect_their_projection(fisheye_camera(), CameraFormat::opencv, "cv2", opencv_python);
}
TEST(TheirReaders, MrcalReadsABrownLens) {
  expect_their_projection(brown_camera(), CameraFormat::mrcal, "mrcal", mrcal_python);
}
TEST(TheirReaders, MrcalReadsAPinhole) {
  expect_their_projection(pinhole_camera(), CameraFormat::mrcal, "mrcal", mrcal_python);
}

TEST(TheirWriters, WeReadWhatOpenCvAndMrcalWrite) {
  if (testing::run_program({"/usr/bin/python3", "-c", "import numpy, cv2, mrcal"}).code != 0) {
    GTEST_SKIP() << "Debian's python3 has no module cv2 or mrcal";
  }
  const testing::TemporaryFolder folder;
  write_file(folder.path() / "write.py", R"(
import cv2, mrcal, numpy
p = [901.25, 905.7, 640.1, 470.9, -0.25, 0.1, 0.001, -0.0005, -0.02]
mrcal.cameramodel(intrinsics=('LENSMODEL_OPENCV5', numpy.array(p)), imagersize=(1280, 960)).write('m.cameramodel')
for name in 'c.yaml', 'c.xml', 'c.json':
    f = cv2.FileStorage(name, cv2.FILE_STORAGE_WRITE)
    f.write('image_width', 1280)
    f.write('image_height', 960)
    f.write('camera_matrix', numpy.array([[p[0], 0, p[2]], [0, p[1], p[3]], [0, 0, 1.0]]))
    f.write('distortion_coefficients', numpy.array(p[4:]))
    f.release()
)");
  ASSERT_EQ(testing::run_program({"/usr/bin/python3", "write.py"}, folder.path().string()).code, 0);
  Eigen::VectorXd expected = params(brown_camera().lens);
  expected[0] = 901.25;
  for (const char* name : {"m.cameramodel", "c.yaml", "c.xml", "c.json"}) {
    const Camera camera = read_camera(folder.path() / name);
    EXPECT_EQ(camera.width_px, 1280) << name;
    // mrcal writes 10 digits or so; OpenCV all of them
    EXPECT_LT((params(camera.lens) - expected).cwiseAbs().maxCoeff(), 1e-8) << name;
  }
}

}  // namespace
}  // namespace alidade
