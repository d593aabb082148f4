#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "alidade/localize/checks/judge.h"

namespace alidade {

double supported_z(const GivenNumber& given, const Camera& camera) {
  constexpr double any_focal = 0.2, any_centre = 0.05, any_k1 = 0.3;  // as a path's lens is freed: path_lens.cpp
  double any = std::numeric_limits<double>::infinity();
  if (given.name == "focal length") any = any_focal;
  if (given.name.starts_with("centre")) any = any_centre * camera.width_px;
  if (given.name == "k1") any = any_k1;
  return given.z == 0.0 ? 0.0 : std::abs(given.z) / std::hypot(1.0, given.asked / (given.z * any));
}

std::string lens_changes(const Localization& report) {
  const std::vector<std::string> names = param_names(report.camera.lens);
  const Eigen::VectorXd now = params(report.camera.lens), given = params(report.given_camera->lens);
  const auto by_sigma = [&](std::size_t i) {
    const auto at = std::ranges::find(names, report.lens_params[i]) - names.begin();
    return std::abs(now[at] - given[at]) / report.sigma_lens[static_cast<Eigen::Index>(i)];
  };
  double most = 0.0;  // where each may be for another, the one that is furthest off
  for (std::size_t i = 0; i < report.lens_params.size(); ++i)
    if (report.lens_params[i] != "fy") most = std::max(most, by_sigma(i));
  std::string text;
  for (std::size_t i = 0; i < report.lens_params.size(); ++i) {
    const std::string& name = report.lens_params[i];
    const auto at = std::ranges::find(names, name) - names.begin();
    const double by = now[at] - given[at], z = by_sigma(i);
    constexpr double worth_a_word = 3.0;
    if (name == "fy" || !(z >= std::min(worth_a_word, most))) continue;
    const std::string sign = by > 0.0 ? "+" : "";
    text += (text.empty() ? "" : ", ") +
            (name == "fx" ? "focal length " + sign + text_of(100.0 * by / given[at], 2) + " %"
             : name == "cx" || name == "cy"
                 ? "centre " + std::string(name == "cx" ? "u " : "v ") + sign + text_of(by, 2) + " px"
                 : name + " " + sign + text_of(by, 2)) +
            " (" + text_of(z, 2) + "σ)";
  }
  return text;
}

}  // namespace alidade
