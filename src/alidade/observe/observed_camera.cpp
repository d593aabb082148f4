#include <algorithm>
#include <array>

#include "alidade/observe/solve/solve.h"

namespace alidade {

void undistort(const Camera& camera, const Eigen::Vector2d& unseen, std::vector<Eigen::Vector2d>& pixels) {
  const Eigen::VectorXd known = params(camera.lens);
  for (Eigen::Vector2d& px : pixels) {
    if (!is_seen(px)) continue;
    const auto ray = unproject(camera, px);
    px = ray && ray->z() > 1e-6
             ? Eigen::Vector2d(known[0] * ray->x() / ray->z() + known[2], known[1] * ray->y() / ray->z() + known[3])
             : unseen;
  }
}

Camera observed_camera(const ObserveReport& report, const std::optional<Camera>& known) {
  Camera camera;
  camera.width_px = report.width_px;
  camera.height_px = report.height_px;
  camera.rms_px = report.sigma_px * std::sqrt(2.0);
  camera.source = "alidade observe";
  const bool bends = std::any_of(report.quantities.begin(), report.quantities.end(), [](const auto& quantity) {
    return quantity.name.starts_with("k") || quantity.name.starts_with("p");
  });
  camera.lens = known ? known->lens : *make_lens(bends ? "brown" : "pinhole");
  Eigen::VectorXd values = params(camera.lens);
  const auto names = param_names(camera.lens);
  camera.cov = Eigen::MatrixXd::Zero(values.size(), values.size());
  std::vector<Eigen::Index> place;
  for (const ObservedQuantity& quantity : report.quantities) {
    const auto at = std::find(names.begin(), names.end(), quantity.name);
    place.push_back(at == names.end() ? -1 : at - names.begin());
    if (place.back() >= 0) values[place.back()] = quantity.value;
  }
  camera.lens = with_params(camera.lens, values);
  for (std::size_t i = 0; i < place.size(); ++i) {
    for (std::size_t j = 0; j < place.size(); ++j) {
      if (place[i] < 0 || place[j] < 0) continue;
      camera.cov(place[i], place[j]) = report.covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
    }
  }
  if (!camera.cov.allFinite()) camera.cov.resize(0, 0);
  return camera;
}

std::string_view event_name(ObserveEvent event) {
  static constexpr std::array<std::string_view, 8> names{"",     "start",    "burst",   "slip",
                                                         "zoom", "zoom_end", "restart", "gap"};
  return names[static_cast<std::size_t>(event)];
}

}  // namespace alidade
