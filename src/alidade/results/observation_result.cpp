#include "alidade/results/observation_result.h"

#include <map>
#include <nlohmann/json.hpp>

#include "alidade/files/files.h"
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

/// Where each point was seen last.
std::vector<Eigen::Vector2d> last_pixels(const Json& points) {
  const auto point = points.at("point").get<std::vector<int>>();
  const auto u = points.at("u_px").get<std::vector<double>>(), v = points.at("v_px").get<std::vector<double>>();
  if (u.size() != point.size() || v.size() != point.size()) throw InputError("data.points is not a table");
  std::map<int, Eigen::Vector2d> last;
  for (std::size_t i = 0; i < point.size(); ++i) last[point[i]] = {u[i], v[i]};
  std::vector<Eigen::Vector2d> pixels;
  for (const auto& [index, px] : last) pixels.push_back(px);
  return pixels;
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
    now.points_px = last_pixels(json.at("data").at("points"));
  } catch (const Json::exception&) {
    throw InputError(file.string() + ": not a result.json of alidade observe");
  } catch (const InputError& error) {
    const std::string what = error.what();
    throw InputError(what.starts_with(file.string()) ? what : file.string() + ": " + what);
  }
  const bool is_sane =
      now.width_px > 0 && now.height_px > 0 && now.k_px.head<2>().minCoeff() > 0.0 && now.sigma_px > 0.0;
  if (!is_sane) throw InputError(file.string() + ": the camera in it is none");
  return now;
}

}  // namespace alidade
