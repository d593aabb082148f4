#include "alidade/formats/camera_formats.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace alidade::detail {

std::size_t chosen_camera(const std::vector<std::string>& names, const CameraText& file) {
  const std::string all = fmt::format("{}", fmt::join(names, ", "));
  if (names.empty()) refuse(file.name, "", "holds no camera");
  if (file.choice.empty()) {
    if (names.size() == 1) return 0;
    refuse(file.name, "",
           fmt::format("holds {} cameras ({}); choose one: {}:{}", names.size(), all, file.name, names[0]));
  }
  const auto found = std::find(names.begin(), names.end(), file.choice);
  if (found == names.end()) refuse(file.name, "", fmt::format("has no camera '{}'; it has {}", file.choice, all));
  if (std::count(found, names.end(), file.choice) > 1)
    refuse(file.name, "", fmt::format("has more than one camera '{}'", file.choice));
  return static_cast<std::size_t>(found - names.begin());
}

std::vector<std::string> place_among(const std::vector<std::string>& names, std::size_t chosen) {
  if (names.size() < 2) return {};
  return {fmt::format("that it is {} of {} cameras ({})", names[chosen], names.size(), fmt::join(names, ", "))};
}

std::vector<double> focal_and_centre(const Camera& camera) {
  const Eigen::VectorXd values = params(camera.lens);
  return {values[0], values[1], values[2], values[3]};
}

std::vector<double> distortion(const Camera& camera) {
  const Eigen::VectorXd values = params(camera.lens);
  return {values.data() + 5, values.data() + values.size()};
}

namespace {

void require_focal_lengths(const std::vector<double>& focal_centre, const std::string& file) {
  const char* names[] = {"fx", "fy"};
  for (std::size_t i = 0; i < 2; ++i) {
    if (!(focal_centre[i] > 0.0)) refuse(file, names[i], fmt::format("{} is not above zero", focal_centre[i]));
  }
}

}  // namespace

Camera opencv_camera(const std::vector<double>& focal_centre, const std::vector<double>& coefficients,
                     const std::string& file, const std::string& key) {
  static const char* const names[] = {"k1", "k2", "p1", "p2", "k3", "k4",    "k5",
                                      "k6", "s1", "s2", "s3", "s4", "tau_x", "tau_y"};
  require_focal_lengths(focal_centre, file);
  const std::size_t count = coefficients.size();
  if (count != 0 && count != 4 && count != 5 && count != 8 && count != 12 && count != 14) {
    refuse(file, key, fmt::format("{} coefficients; OpenCV has 4, 5, 8, 12 or 14", count));
  }
  for (std::size_t i = 5; i < count; ++i) {
    if (coefficients[i] == 0.0) continue;
    const char* kind = i < 8 ? "a rational lens" : i < 12 ? "a thin prism" : "a tilted sensor";
    refuse(file, key,
           fmt::format("{} is {}: {} is no model of ours (pinhole, brown, kannala_brandt)", names[i], coefficients[i],
                       kind));
  }
  Camera camera;
  const bool is_pinhole = std::all_of(coefficients.begin(), coefficients.end(), [](double k) { return k == 0.0; });
  if (is_pinhole) {
    camera.lens = Calibrated<Pinhole>{{focal_centre[0], focal_centre[1], focal_centre[2], focal_centre[3], 0.0}};
    return camera;
  }
  Calibrated<Brown> lens;
  for (int i = 0; i < 4; ++i) lens.params[i] = focal_centre[static_cast<std::size_t>(i)];
  for (std::size_t i = 0; i < std::min<std::size_t>(count, 5); ++i)
    lens.params[5 + static_cast<int>(i)] = coefficients[i];
  camera.lens = lens;
  return camera;
}

Camera fisheye_camera(const std::vector<double>& focal_centre, const std::vector<double>& coefficients,
                      const std::string& file, const std::string& key) {
  require_focal_lengths(focal_centre, file);
  if (coefficients.size() != 4) refuse(file, key, fmt::format("{} coefficients; a fisheye has 4", coefficients.size()));
  Calibrated<KannalaBrandt> lens;
  for (int i = 0; i < 4; ++i) lens.params[i] = focal_centre[static_cast<std::size_t>(i)];
  for (int i = 0; i < 4; ++i) lens.params[5 + i] = coefficients[static_cast<std::size_t>(i)];
  Camera camera;
  camera.lens = lens;
  return camera;
}

}  // namespace alidade::detail
