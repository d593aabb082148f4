#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "alidade/localize/checks/judge.h"
#include "alidade/localize/config.h"

namespace alidade {
namespace {

/// "0.5 %", "3 px", "12 ms": the change that the observations indicate.
std::string asked_text(const GivenNumber& given) {
  const double asked = given.asked;
  if (given.name == "focal length" || given.name == "shape of the target") return text_of(100.0 * asked, 2) + " %";
  if (given.name.starts_with("centre")) return text_of(asked, 2) + " px";
  if (given.name == "speed of the target") return text_of(1000.0 * std::abs(asked), 2) + " mm/s";
  if (given.name == "rotation of the target") return text_of(std::abs(asked) * 180.0 / std::numbers::pi, 2) + "°/s";
  if (given.name == "readout") return text_of(1000.0 * asked, 2) + " ms";
  return text_of(asked, 2);
}

/// Behind a flat port another focal length and water of another index look alike.
std::string as_water_text(const Localization& report) {
  const std::vector<std::string> names = param_names(report.camera.lens);
  const auto index = std::ranges::find(names, "n_water") - names.begin();
  if (index == std::ssize(names) || std::ranges::find(report.lens_params, "fx") == report.lens_params.end()) return "";
  const Eigen::VectorXd now = params(report.camera.lens), given = params(report.given_camera->lens);
  return " (water of index " + text_of(given[index] * now[0] / given[0], 4) + " and not " + text_of(given[index], 4) +
         " looks the same)";
}

}  // namespace

double moved_sigmas(const GivenNumber& given, const Localization& report) {
  const double moved = std::abs(given.asked * given.moves);
  const bool is_speed = given.name == "speed of the target", is_rotation = given.name == "rotation of the target";
  if (!is_speed && !is_rotation) return moved;
  double least = std::numeric_limits<double>::infinity();
  for (const PathStep& step : report.path)
    if (step.has_pose()) least = std::min(least, step.cov.diagonal().segment<3>(is_speed ? 0 : 3).minCoeff());
  const double half_s = 0.5 * (report.path.back().t_s - report.path.front().t_s);
  return std::max(moved, half_s * std::abs(given.asked) / std::sqrt(least));
}

std::string cause_text(const GivenNumber& given, const Localization& report) {
  const std::string size = asked_text(given), z = " (" + text_of(std::abs(given.z), 2) + "σ)";
  if (given.name == "shape of the target") return "the target is longer along x, against y, than given, by " + size + z;
  if (given.name == "speed of the target") return "the target moves against the other points, by " + size + z;
  if (given.name == "rotation of the target") return "the target rotates against the other points, by " + size + z;
  if (given.name == "readout")
    return "rows are not of one moment: a rolling shutter of " + size + " from the first to the last" + z;
  if (given.name == "water's index")
    return "the observations indicate water of another index, by " + size + z +
           ": the camera file is not of this lens and port in this water";
  const bool has_imu = report.imu && report.imu->fault == ImuFault::none;
  return "the observations indicate another " + std::string(given.name) + ", by " + size + z +
         ": the camera file is not of this lens as it was used" +
         (has_imu ? ", or the IMU's rates (scale, axes) are not as they say" : "");
}

double supported_z(const GivenNumber& given, const Camera& camera) {
  constexpr double any_focal = 0.2, any_centre = 0.05, any_k1 = 0.3;  // as when a path's lens is freed: path_lens.cpp
  double any = std::numeric_limits<double>::infinity();
  if (given.name == "focal length") any = any_focal;
  if (given.name.starts_with("centre")) any = any_centre * camera.width_px;
  if (given.name == "k1") any = any_k1;
  return given.z == 0.0 ? 0.0 : std::abs(given.z) / std::hypot(1.0, given.asked / (given.z * any));
}

double doubt_of(const GivenNumber& given, const Localization& report) {
  constexpr double care_z = 3.5, care_z_far = 2.4, far_sigmas = 5.0;
  const bool is_worse = !report.is_of_images && report.sigma_px_from == SigmaPxFrom::residuals &&
                        report.sigma_px > LocalizationFilterConfig{}.sigma_px;
  const bool may_be_far = given.name == "water's index" || (is_worse && given.name == "focal length");
  const bool is_far = may_be_far && moved_sigmas(given, report) > far_sigmas;
  return supported_z(given, report.camera) / (is_far ? care_z_far : care_z);
}

std::string lens_changes(const Localization& report) {
  const std::vector<std::string> names = param_names(report.camera.lens);
  const Eigen::VectorXd now = params(report.camera.lens), given = params(report.given_camera->lens);
  const auto by_sigma = [&](std::size_t i) {
    const auto at = std::ranges::find(names, report.lens_params[i]) - names.begin();
    return std::abs(now[at] - given[at]) / report.sigma_lens[static_cast<Eigen::Index>(i)];
  };
  double most = 0.0;  // if correlated changes are all small, the largest one
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
  return text + as_water_text(report);
}

void add_hidden(const Localization& report, Verdict& verdict) {
  constexpr double worth_a_word = 1.1;
  for (const GivenNumber& given : report.given) {
    const double enlarged = std::hypot(1.0, given.moves * given.sigma_hidden);
    if (!(given.sigma_hidden > 0.0) || enlarged < worth_a_word) continue;
    const bool is_focal = given.name == "focal length";
    const double hidden = is_focal ? 100.0 * given.hidden : given.hidden;
    const std::string unit = is_focal ? "%" : "px";
    verdict.checks.push_back({std::string(given.name), State::good,
                              "the observations would not show another " + std::string(given.name) + ", by up to " +
                                  text_of(hidden, 2) + " " + unit + ": σ is enlarged up to " + text_of(enlarged, 2) +
                                  " times for it",
                              hidden, 0.0, unit, "path"});
  }
}

}  // namespace alidade
