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

}  // namespace
}  // namespace alidade
