#include "alidade/simulate/example_camera.h"

#include <gtest/gtest.h>

namespace alidade {
namespace {

TEST(ExampleCamera, SeesThroughEveryPixelOfEveryModel) {
  int checked = 0;
  for (const std::string_view model : {"pinhole", "brown", "kannala_brandt"}) {
    const auto camera = example_camera(model, 640, 480);
    ASSERT_TRUE(camera) << model;
    EXPECT_EQ(model_name(camera->lens), model);
    for (int v = -8; v <= 488; v += 8)
      for (int u = -8; u <= 648; u += 8, ++checked)
        ASSERT_TRUE(unproject(*camera, {u, v})) << model << ' ' << u << ' ' << v;
  }
  EXPECT_EQ(checked, 3 * 63 * 83);
  EXPECT_FALSE(example_camera("thin_lens", 640, 480));
}

}  // namespace
}  // namespace alidade
