#include "alidade/simulate/example_camera.h"

#include <array>

namespace alidade {

std::optional<Camera> example_camera(std::string_view model_name, int width_px, int height_px) {
  auto lens = make_lens(model_name);
  if (!lens) return std::nullopt;
  const std::vector<std::string> names = param_names(*lens);
  Eigen::VectorXd values = params(*lens);
  const auto set = [&](std::string_view name, double value) {
    for (std::size_t i = 0; i < names.size(); ++i)
      if (names[i] == name) values[static_cast<Eigen::Index>(i)] = value;
  };
  const bool is_fisheye = model_name == KannalaBrandt::name;
  const double focal_px = (is_fisheye ? 0.55 : 0.8) * width_px;
  set("fx", focal_px);
  set("fy", 1.002 * focal_px);
  set("cx", 0.5 * (width_px - 1) + 0.006 * width_px);
  set("cy", 0.5 * (height_px - 1) - 0.008 * height_px);
  set("k1", is_fisheye ? 0.03 : -0.25);
  set("k2", is_fisheye ? -0.008 : 0.1);
  set("p1", 0.0004);
  set("p2", -0.0003);
  set("k3", is_fisheye ? 0.001 : -0.02);
  set("gap_m", 0.02);
  set("glass_m", 0.01);
  set("n_glass", 1.5);
  set("n_water", 1.34);
  set("normal_x", 0.01);
  set("normal_y", -0.015);
  return Camera{width_px, height_px, with_params(*lens, values), {}, 0.0, "alidade simulate"};
}

}  // namespace alidade
