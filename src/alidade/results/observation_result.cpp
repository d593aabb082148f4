#include "alidade/results/observation_result.h"

#include <limits>
#include <nlohmann/json.hpp>

#include "alidade/files/files.h"
#include "alidade/observe/next_move.h"
#include "alidade/results/result_document.h"

namespace alidade {
namespace {

using Json = nlohmann::json;

/// Upper triangle, row by row, of the first four parameters.
Eigen::Matrix4d covariance_of(const Json& json) {
  const auto num = static_cast<int>(json.at("names").size());
  const auto upper = json.at("upper").get<std::vector<double>>();
  if (num < 4 || upper.size() != static_cast<std::size_t>(num * (num + 1) / 2))
    throw InputError("covariance is not one");
  Eigen::Matrix4d cov;
  std::size_t at = 0;
  for (int i = 0; i < 4; ++i) {
    for (int j = i; j < num; ++j, ++at) {
      if (j < 4) cov(i, j) = cov(j, i) = upper[at];
    }
  }
  return cov;
}

std::vector<ObserveResidual> pixels_of(const Json& points) {
  const auto row = points.at("step").get<std::vector<int>>(), point = points.at("point").get<std::vector<int>>();
  const auto u = points.at("u_px").get<std::vector<double>>(), v = points.at("v_px").get<std::vector<double>>();
  if (row.size() != point.size() || u.size() != point.size() || v.size() != point.size())
    throw InputError("data.points is not a table");
  std::vector<ObserveResidual> pixels;
  for (std::size_t i = 0; i < point.size(); ++i)
    pixels.push_back({.row = row[i], .point = point[i], .px = {u[i], v[i]}});
  return pixels;
}

double number_or(const Json& object, const char* name, double otherwise) {
  const auto found = object.find(name);
  return found == object.end() || found->is_null() ? otherwise : found->get<double>();
}

/// Rows a second; steps may be thinned, the first and the last one stay.
double frames_per_s(const Json& json) {
  const Json& t_s = json.at("data").at("steps").at("t_s");
  if (t_s.size() < 2) return 0.0;
  const double seconds = t_s.back().get<double>() - t_s.front().get<double>();
  return seconds > 0.0 ? (json.at("counts").at("given").get<double>() - 1.0) / seconds : 0.0;
}

RotationSource source_of(const std::string& word) {
  for (const RotationSource source : {RotationSource::rate, RotationSource::head, RotationSource::attitude})
    if (word == source_name(source)) return source;
  return RotationSource::none;
}

/// How the rotation was measured, and what was assumed of it. A result of an earlier version does not say how.
void read_rotation(const Json& json, ObservedNow& now) {
  const Json& estimate = json.at("estimate");
  if (const auto rotation = estimate.find("rotation"); rotation != estimate.end()) {
    now.source = source_of(rotation->at("source").get<std::string>());
    now.sigma_angle_rad = number_or(*rotation, "sigma_angle_rad", std::numeric_limits<double>::infinity());
    now.sigma_rate_rad_per_s = number_or(*rotation, "sigma_rate_rad_per_s", 0.0);
  }
  for (const Json& each : json.at("assumed")) {
    Assumption assumption{.name = each.at("name").get<std::string>()};
    if (!each.at("sigma").is_null()) assumption.sigma = each.at("sigma").get<double>();
    now.assumed.push_back(assumption);
  }
  const Json &stddev = json.at("stddev"), &model = json.at("stddev_model").at("camera");
  for (const auto& [name, sigma] : stddev.items())
    if (sigma.is_number()) assume_estimated(name, sigma.get<double>(), now.assumed);
  assume_estimated("k1", number_or(stddev.at("camera"), "k1", 0.0), now.assumed);
  now.sigma_model_px = {number_or(model, "fx", 0.0), number_or(model, "fy", 0.0), number_or(model, "cx", 0.0),
                        number_or(model, "cy", 0.0)};
}

}  // namespace

ObservedNow read_observation(const std::filesystem::path& result) {
  const std::filesystem::path file = std::filesystem::is_directory(result) ? result / "result.json" : result;
  ObservedNow now;
  try {
    const Json json = Json::parse(read_file(file));
    if (json.at("command") != "observe") {
      throw InputError("is the result of '" + json.at("command").get<std::string>() + "', not of observe");
    }
    if (!is_estimate(json.at("verdict").at("exit_code").get<int>())) {
      throw InputError("this observation was refused: " + json.at("verdict").value("to_add", ""));
    }
    const Json& estimate = json.at("estimate");
    const Json& camera = estimate.at("camera");
    now.width_px = camera.at("width").get<int>();
    now.height_px = camera.at("height").get<int>();
    now.k_px = {camera.at("fx").get<double>(), camera.at("fy").get<double>(), camera.at("cx").get<double>(),
                camera.at("cy").get<double>()};
    now.sigma_px = estimate.at("sigma_px").get<double>();
    now.cov_px2 = covariance_of(json.at("covariance"));
    now.design_effect = number_or(estimate.at("shared_errors"), "design_effect", 1.0);
    now.frames_per_s = frames_per_s(json);
    read_rotation(json, now);
    now.points_px = points_at_end(pixels_of(json.at("data").at("points")), now.frames_per_s);
  } catch (const Json::exception&) {
    throw InputError(file.string() + ": not a result.json of alidade observe");
  } catch (const InputError& error) {
    const std::string what = error.what();
    throw InputError(what.starts_with(file.string()) ? what : file.string() + ": " + what);
  }
  const bool is_sane =
      now.width_px > 0 && now.height_px > 0 && now.k_px.head<2>().minCoeff() > 0.0 && now.sigma_px > 0.0;
  if (!is_sane) throw InputError(file.string() + ": the camera in it is none");
  if (now.source == RotationSource::none)
    throw InputError(file.string() +
                     ": its rotation was not measured, and moves are planned of a head that measures it");
  return now;
}

}  // namespace alidade
