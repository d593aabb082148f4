#include "alidade/results/identified_result.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "alidade/files/files.h"
#include "alidade/results/result_document.h"

namespace alidade {
namespace {

using Json = nlohmann::json;

/// What is null was not shown by the log.
void take_number(const Json& axis, const char* name, double& value) {
  if (const Json& number = axis.at(name); number.is_number()) value = number.get<double>();
}

PositionerParams axis_of(const Json& json, PositionerParams axis) {
  take_number(json, "rate_rad_s", axis.rate_rad_s);
  take_number(json, "acceleration_rad_s2", axis.acceleration_rad_s2);
  take_number(json, "time_constant_s", axis.time_constant_s);
  take_number(json, "latency_s", axis.latency_s);
  take_number(json, "backlash_rad", axis.backlash_rad);
  take_number(json, "dead_band_rad", axis.dead_band_rad);
  return axis;
}

IdentifiedHead head_of(const Json& json, const PositionerParams& usual_axis) {
  const Json& axes = json.at("estimate").at("axes");
  if (!is_estimate(json.at("verdict").at("exit_code").get<int>()))
    throw InputError("this identification was refused: " + json.at("verdict").value("sentence", ""));
  IdentifiedHead head;
  std::size_t i = 0;
  for (const char* name : {"pan", "tilt"}) {
    head.axes[i++] = axis_of(axes.at(name), usual_axis);
    double step_rad = 0.0;
    take_number(axes.at(name), "resolution_rad", step_rad);
    head.resolution_rad = std::max(head.resolution_rad, step_rad);
  }
  return head;
}

}  // namespace

IdentifiedHead read_identified_head(const std::filesystem::path& result, const PositionerParams& usual_axis) {
  const std::filesystem::path file = std::filesystem::is_directory(result) ? result / "result.json" : result;
  IdentifiedHead head;
  try {
    head = head_of(Json::parse(read_file(file)), usual_axis);
  } catch (const Json::exception&) {
    throw InputError(file.string() + ": not a result.json of alidade head --identify");
  } catch (const InputError& error) {
    const std::string what = error.what();
    throw InputError(what.starts_with(file.string()) ? what : file.string() + ": " + what);
  }
  const bool is_sane = std::ranges::all_of(head.axes, [](const PositionerParams& axis) {
    return axis.rate_rad_s > 0.0 && axis.time_constant_s >= 0.0 && axis.latency_s >= 0.0 && axis.latency_s < 10.0;
  });
  if (!is_sane) throw InputError(file.string() + ": the axes in it are none");
  return head;
}

}  // namespace alidade
