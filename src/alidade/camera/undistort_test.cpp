#include "alidade/camera/undistort.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace alidade {
namespace {

Camera brown_camera() {
  return {160, 120, Calibrated<Brown>{Params<Brown>{120, 121, 80.2, 59.1, 0, -0.25, 0.1, 0.001, -0.0005, -0.02}},
          {},  0.0, {}};
}

TEST(Undistort, MapsEachPixelToWhereTheLensSeesItsDirection) {
  const Camera source = brown_camera(), target = undistorted_camera(source);
  EXPECT_EQ(model_name(target.lens), "pinhole");
  const PixelMap map = undistortion_map(source, target);
  ASSERT_EQ(map.u_px.size(), 160u * 120u);
  int inside = 0;
  for (int v = 0; v < 120; ++v) {
    for (int u = 0; u < 160; ++u) {
      const std::size_t at = std::size_t(v * 160 + u);
      const Eigen::Vector3d ray((u - 80.2) / 120.0, (v - 59.1) / 121.0, 1.0);
      const Eigen::Vector2d px = project(source, ray).value();
      EXPECT_NEAR(map.u_px[at], px.x(), 1e-4);
      EXPECT_NEAR(map.v_px[at], px.y(), 1e-4);
      ++inside;
    }
  }
  EXPECT_EQ(inside, 160 * 120);  // a barrel lens shows more than the pinhole needs
}

TEST(Undistort, IsBlackWhereTheLensSeesNothing) {
  const Camera source = brown_camera();
  const PixelMap map = undistortion_map(source, undistorted_camera(source, 0.25));
  EXPECT_EQ(map.u_px.front(), -1.0f);
  EXPECT_EQ(map.v_px.front(), -1.0f);
  EXPECT_GT(map.u_px[std::size_t(60 * 160 + 80)], 0.0f);
}

TEST(FieldOfView, OfAPinholeAndAFisheyeHaveClosedForms) {
  const Camera pinhole{640, 480, Calibrated<Pinhole>{{500, 500, 319.5, 239.5, 0}}, {}, 0.0, {}};
  EXPECT_NEAR(field_of_view(pinhole).horizontal_rad, 2.0 * std::atan(320.0 / 500.0), 1e-12);
  EXPECT_NEAR(field_of_view(pinhole).vertical_rad, 2.0 * std::atan(240.0 / 500.0), 1e-12);
  EXPECT_NEAR(field_of_view(pinhole).diagonal_rad, 2.0 * std::atan(400.0 / 500.0), 1e-12);
  const Camera fisheye{640, 480, Calibrated<KannalaBrandt>{Params<KannalaBrandt>{180, 180, 300, 200, 0, 0, 0, 0, 0}},
                       {},  0.0, {}};
  EXPECT_NEAR(field_of_view(fisheye).horizontal_rad, 640.0 / 180.0, 1e-12);  // beyond π: it sees backwards
  const Camera folded{768, 576, Calibrated<Brown>{Params<Brown>{576, 576, 384, 288, 0, -0.45, 0.07, 0, 0, 0}},
                      {},  0.0, {}};
  EXPECT_TRUE(std::isnan(field_of_view(folded).diagonal_rad));
}

}  // namespace
}  // namespace alidade
