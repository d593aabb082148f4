#include "alidade/results/fleet_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>

#include "alidade/files/json_value.h"
#include "alidade/geometry/degree.h"
#include "alidade/results/result_document.h"

namespace alidade {
namespace {

constexpr std::string_view version = "3:", version_before = "2:";  // of a checkpoint
constexpr double largest = 1e12;

double number_in(const nlohmann::json& json, const char* name) {
  const auto found = json.find(name);
  if (found == json.end() || !found->is_number()) return std::numeric_limits<double>::quiet_NaN();
  const double value = found->get<double>();
  return std::abs(value) <= largest ? value : std::numeric_limits<double>::quiet_NaN();
}

/// An angle, or the same in degrees where its name ends in _deg.
double angle_in(const nlohmann::json& json, const std::string& name) {
  if (json.contains(name)) return number_in(json, name.c_str());
  return degree * number_in(json, (name + "_deg").c_str());
}

/// Neither a number, nor said not to be there.
bool is_odd(const nlohmann::json& json, const char* name) {
  const auto found = json.find(name);
  return found != json.end() && !found->is_null() && !std::isfinite(number_in(json, name));
}

void read_rotation(const nlohmann::json& json, FleetRow& row) {
  if (json.contains("pan") || json.contains("pan_deg")) {
    const bool has_roll = json.contains("roll") || json.contains("roll_deg");
    row.source = FleetSource::head;
    row.rotation = {angle_in(json, "pan"), angle_in(json, "tilt"), has_roll ? angle_in(json, "roll") : 0.0, 0.0};
  } else if (json.contains("qw")) {
    row.source = FleetSource::attitude;
    row.rotation = {number_in(json, "qw"), number_in(json, "qx"), number_in(json, "qy"), number_in(json, "qz")};
  } else {
    const double z = json.contains("omega_z") ? number_in(json, "omega_z") : 0.0;
    row.source = FleetSource::rate;
    row.rotation = {number_in(json, "omega_x"), number_in(json, "omega_y"), z, 0.0};
  }
}

std::string number_or_null(double value) { return std::isfinite(value) ? fmt::format("{}", value) : "null"; }

/// Of a camera without a temperature nothing is said of it.
std::string members(const Eigen::Matrix<double, num_fleet_common, 1>& values, bool has_temperature) {
  static constexpr std::array<const char*, num_fleet_common> names{
      "fx", "fy", "cx", "cy", "pan_zero_rad", "tilt_zero_rad", "focal_per_c"};
  std::string text = "{";
  for (std::size_t i = 0; i < names.size() - (has_temperature ? 0 : 1); ++i)
    text +=
        fmt::format("{}\"{}\":{}", i == 0 ? "" : ",", names[i], number_or_null(values[static_cast<Eigen::Index>(i)]));
  return text + "}";
}

std::string quoted(const std::string& text) { return JsonValue(text).text(); }

constexpr std::string_view digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

}  // namespace

std::optional<FleetRow> parse_fleet_row(std::string_view payload, std::string& fault) {
  try {
    const bool is_text = !payload.empty() && (payload.front() == '{' || payload.front() == ' ');
    const nlohmann::json json = is_text ? nlohmann::json::parse(payload) : nlohmann::json::from_cbor(payload);
    FleetRow row;
    const auto& n = json.at("n");
    row.n = n.is_number_integer() ? n.get<std::int64_t>() : 0;
    if (row.n < 1) {
      fault = "n is not 1, 2, 3 …";
      return std::nullopt;
    }
    row.t_s = number_in(json, "t");
    row.temperature_c = number_in(json, "temperature_c");
    if (is_odd(json, "temperature_c")) row.in_part = FleetFault::temperature;
    read_rotation(json, row);
    row.px.fill(std::numeric_limits<double>::quiet_NaN());
    static constexpr std::array<const char*, 2 * max_fleet_points> names{"p1x", "p1y", "p2x", "p2y", "p3x", "p3y",
                                                                         "p4x", "p4y", "p5x", "p5y", "p6x", "p6y"};
    for (std::size_t i = 0; i < names.size(); ++i) {
      row.px[i] = number_in(json, names[i]);
      if (is_odd(json, names[i])) row.in_part = FleetFault::pixel;
      if (std::isfinite(row.px[i])) row.num_points = static_cast<int>(i / 2 + 1);
    }
    return row;
  } catch (const std::exception&) {
    fault = "neither JSON nor CBOR of a row";
    return std::nullopt;
  }
}

std::string fleet_row_text(const FleetRow& row) {
  const auto& r = row.rotation;
  std::string text = fmt::format("{{\"n\":{},\"t\":{}", row.n, row.t_s);
  if (row.source == FleetSource::head) text += fmt::format(",\"pan\":{},\"tilt\":{}", r[0], r[1]);
  if (row.source == FleetSource::attitude)
    text += fmt::format(",\"qw\":{},\"qx\":{},\"qy\":{},\"qz\":{}", r[0], r[1], r[2], r[3]);
  if (row.source == FleetSource::rate)
    text += fmt::format(",\"omega_x\":{},\"omega_y\":{},\"omega_z\":{}", r[0], r[1], r[2]);
  if (std::isfinite(row.temperature_c)) text += fmt::format(",\"temperature_c\":{:.3f}", row.temperature_c);
  for (std::size_t k = 0; k < static_cast<std::size_t>(row.num_points); ++k) {
    if (!std::isfinite(row.px[2 * k])) continue;
    text += fmt::format(",\"p{}x\":{:.4f},\"p{}y\":{:.4f}", k + 1, row.px[2 * k], k + 1, row.px[2 * k + 1]);
  }
  return text + "}";
}

FleetRow fleet_row_of(const FleetObservation& observation, std::int64_t n) {
  FleetRow row;
  row.n = n;
  row.t_s = observation.t_s;
  row.temperature_c = observation.temperature_c;
  row.rotation = {observation.pan_rad, observation.tilt_rad, 0.0, 0.0};
  row.num_points = static_cast<int>(observation.px.size() / 2);
  row.px.fill(std::numeric_limits<double>::quiet_NaN());
  std::ranges::copy(observation.px, row.px.begin());
  return row;
}

std::string fleet_state_text(const std::string& id, const FleetCamera& camera, const FleetNumbers& numbers) {
  const FleetEstimate estimate = estimate_of(camera);
  const Verdict verdict = verdict_of(camera);
  const std::string order = sentence_of(numbers);
  const std::string sentence = camera.n == 0 ? "no row is taken in yet: those that have come wait for the first ones"
                                             : verdict.sentence + (order.empty() ? "" : "; " + order);
  std::string counts;
  if (numbers.num_missing > 0) counts += fmt::format(",\"missing\":{}", numbers.num_missing);
  if (numbers.num_restarts > 0) counts += fmt::format(",\"restarts\":{}", numbers.num_restarts);
  return fmt::format(
      "{{\"camera\":{},\"n\":{},\"t\":{},\"verdict\":{{\"state\":\"{}\",\"sentence\":{}}},\"estimate\":{},\"stddev\":{}"
      "{}}}",
      quoted(id), camera.n, number_or_null(camera.t_s), state_name(verdict.state), quoted(sentence),
      members(estimate.value, estimate.has_temperature), members(estimate.sigma, estimate.has_temperature), counts);
}

std::string fleet_alarm_text(const std::string& id, const FleetAlarm& alarm) {
  return fmt::format("{{\"camera\":{},\"n\":{},\"t\":{},\"kind\":\"{}\",\"value\":{},\"sigma\":{},\"sentence\":{}}}",
                     quoted(id), alarm.n, number_or_null(alarm.t_s), kind_name(alarm.kind), number_or_null(alarm.value),
                     number_or_null(alarm.sigma), quoted(sentence_of(alarm)));
}

std::string checkpoint_text(const FleetCamera& camera) {
  std::array<unsigned char, sizeof(FleetCamera) + 3> bytes{};
  std::memcpy(bytes.data(), &camera, sizeof camera);
  std::string text(version);
  for (std::size_t i = 0; i < sizeof camera; i += 3) {
    const unsigned word =
        static_cast<unsigned>(bytes[i]) << 16U | static_cast<unsigned>(bytes[i + 1]) << 8U | bytes[i + 2];
    for (const unsigned shift : {18U, 12U, 6U, 0U}) text += digits[word >> shift & 63U];
  }
  return text;
}

std::optional<FleetCamera> parse_checkpoint(std::string_view text) {
  constexpr std::size_t num_digits = (sizeof(FleetCamera) + 2) / 3 * 4;
  const bool is_before = text.starts_with(version_before);
  if (!text.starts_with(version) && !is_before) return std::nullopt;
  if (text.size() != version.size() + num_digits) return std::nullopt;
  text.remove_prefix(version.size());
  std::array<unsigned char, sizeof(FleetCamera) + 3> bytes{};
  for (std::size_t i = 0, at = 0; i < text.size(); i += 4) {
    unsigned word = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const std::size_t digit = digits.find(text[i + k]);
      if (digit == std::string_view::npos) return std::nullopt;
      word = word << 6U | static_cast<unsigned>(digit);
    }
    for (const unsigned shift : {16U, 8U, 0U})
      if (at < bytes.size()) bytes[at++] = static_cast<unsigned char>(word >> shift & 255U);
  }
  FleetCamera camera;
  std::memcpy(static_cast<void*>(&camera), bytes.data(), sizeof camera);
  if (is_before) camera.misread = camera.off_centre_percent = camera.off_centre_axis = 0;
  if (is_before && camera.phase == FleetPhase::learning) {  // it kept its rows otherwise: they are gathered again
    camera.num_buffered = 0;
    camera.stride = 1;
    camera.since_kept = 0;
  }
  return camera;
}

std::int64_t fleet_state_n(std::string_view text) {
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
  return json.is_object() && json.contains("n") && json["n"].is_number_integer() ? json["n"].get<std::int64_t>() : 0;
}

}  // namespace alidade
