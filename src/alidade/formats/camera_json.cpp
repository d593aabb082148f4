#include "alidade/formats/camera_json.h"

#include <algorithm>
#include <cmath>

namespace alidade {

bool has_covariance(const Camera& camera) {
  return camera.cov.rows() > 0 && camera.cov.rows() == params(camera.lens).size();
}

JsonValue camera_values(const Camera& camera) {
  JsonValue values = JsonValue::object();
  values["model"] = model_name(camera.lens);
  values["width"] = camera.width_px;
  values["height"] = camera.height_px;
  const std::vector<std::string> names = param_names(camera.lens);
  const Eigen::VectorXd of_lens = params(camera.lens);
  for (std::size_t i = 0; i < names.size(); ++i) values[names[i]] = of_lens[static_cast<Eigen::Index>(i)];
  if (const auto* port = std::get_if<Calibrated<FlatPort>>(&camera.lens)) {
    const Eigen::Vector3d normal = FlatPort::normal(port->params);
    values["normal"] = std::vector<double>{normal.x(), normal.y(), normal.z()};
  }
  return values;
}

JsonValue camera_stddev(const Camera& camera) {
  JsonValue values = JsonValue::object();
  if (!has_covariance(camera)) return values;
  const std::vector<std::string> names = param_names(camera.lens);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const Eigen::Index at = static_cast<Eigen::Index>(i);
    values[names[i]] = std::sqrt(std::max(0.0, camera.cov(at, at)));
  }
  return values;
}

}  // namespace alidade
