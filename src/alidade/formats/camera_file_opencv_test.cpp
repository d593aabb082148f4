#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "alidade/formats/camera_file.h"
#include "alidade/testing/fault.h"
#include "alidade/testing/temporary_folder.h"

// Files of OpenCV that do not say which lens.

namespace alidade {
namespace {

using testing::fault_of;
using ::testing::HasSubstr;

TEST(CameraFile, FourCoefficientsOfOpenCvMayBeThoseOfEitherLens) {
  const testing::TemporaryFolder folder;
  const std::string file = (folder.path() / "c.yml").string();
  const std::string head = "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n";
  const std::string K = "!!opencv-matrix {rows: 3, cols: 3, dt: d, data: [500,0,320,0,501,240,0,0,1]}\n";
  const std::string D = "!!opencv-matrix {rows: 4, cols: 1, dt: d, data: [0.1,0.02,0.003,0.004]}\n";
  for (const auto& [matrix, distortion] :
       {std::pair("camera_matrix: ", "distortion_coefficients: "), std::pair("K: ", "D: ")}) {
    write_file(file, head + matrix + K + distortion + D);
    EXPECT_EQ(model_name(read_camera(file).lens), "brown");
    EXPECT_THAT(lens_doubt(file), HasSubstr("k1 k2 k3 k4 of cv::fisheye"));
    const Camera fisheye = read_camera(file + ":fisheye");
    EXPECT_EQ(model_name(fisheye.lens), "kannala_brandt");
    EXPECT_EQ(params(fisheye.lens)[8], 0.004);
    EXPECT_EQ(model_name(read_camera(file + ":brown").lens), "brown");
    EXPECT_EQ(lens_doubt(file + ":fisheye") + lens_doubt(file + ":brown"), "");
    EXPECT_THAT(fault_of([&, path = file] { (void)read_camera(path + ":left"); }),
                HasSubstr("no lens is called 'left'"));
  }
  for (const std::string said : {"fisheye_model: 1\n", "fisheye_model: 0\n"}) {
    write_file(file, head + "camera_matrix: " + K + "distortion_coefficients: " + D + said);
    EXPECT_EQ(lens_doubt(file), "");
    EXPECT_THAT(fault_of([&] { (void)read_camera(file + ":fisheye"); }), HasSubstr("leave ':fisheye' out"));
  }
  write_file(file, head + "camera_matrix: " + K +
                       "distortion_coefficients: {rows: 1, cols: 5, data: [0.1,0.02,0.003,0.004,0]}\n");
  EXPECT_EQ(lens_doubt(file), "") << "five are of cv::calibrateCamera";
}

TEST(CameraFile, OfOpenCvsStereoPairOneIsChosen) {
  const testing::TemporaryFolder folder;
  const std::string file = (folder.path() / "intrinsics.yml").string();
  const auto matrix = [](int rows, int cols, const std::string& data) {
    return "!!opencv-matrix\n   rows: " + std::to_string(rows) + "\n   cols: " + std::to_string(cols) +
           "\n   dt: d\n   data: [ " + data + " ]\n";
  };
  const std::string pair = "M1: " + matrix(3, 3, "530, 0., 320, 0., 531, 240, 0., 0., 1.") +
                           "D1: " + matrix(1, 5, "-2.8e-01, 0.09, 1e-3, -2e-4, 0.") +
                           "M2: " + matrix(3, 3, "540, 0., 330, 0., 541, 250, 0., 0., 1.") +
                           "D2: " + matrix(1, 5, "-2.9e-01, 0.10, 0., 0., 0.");
  write_file(file, "%YAML:1.0\n---\n" + pair);
  EXPECT_THAT(fault_of([&] { (void)read_camera(file); }), HasSubstr("holds 2 cameras (M1, M2)"));
  EXPECT_THAT(fault_of([&] { (void)read_camera(file + ":M2"); }), HasSubstr("image_width: is missing"));
  write_file(file, "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n" + pair);
  const Camera second = read_camera(file + ":M2");
  EXPECT_EQ(params(second.lens)[1], 541.0);
  EXPECT_EQ(params(second.lens)[5], -0.29);
  EXPECT_EQ(params(read_camera(file + ":M1").lens)[0], 530.0);
  EXPECT_THAT(fault_of([&] { (void)read_camera(file + ":left"); }), HasSubstr("it has M1, M2"));
  EXPECT_THAT(fault_of([&] { (void)read_camera(file + ":M1:fisheye"); }), HasSubstr("leave ':fisheye' out"));
  const std::string four = pair.substr(0, pair.find("D1")) + "D1: " + matrix(1, 4, "0.02, 0.01, -0.004, 0.001");
  write_file(file, "image_width: 640\nimage_height: 480\n" + four +
                       pair.substr(pair.find("M2"), pair.find("D2") - pair.find("M2")));
  EXPECT_THAT(lens_doubt(file + ":M1"), HasSubstr("k1 k2 k3 k4 of cv::fisheye"));
  EXPECT_EQ(model_name(read_camera(file + ":M1:fisheye").lens), "kannala_brandt");
  EXPECT_EQ(model_name(read_camera(file + ":M1:brown").lens), "brown");
  EXPECT_THAT(fault_of([&] { (void)read_camera(file + ":M2"); }), HasSubstr("D2: is missing"));
  write_file(file, "image_width: 640\nimage_height: 480\n" + pair);
  EXPECT_THAT(unread_parts(file + ":M1"), ::testing::ElementsAre(HasSubstr("M1 of 2 cameras")));
}

}  // namespace
}  // namespace alidade
