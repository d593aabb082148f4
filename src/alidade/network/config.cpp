#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "alidade/network/report.h"

namespace alidade {
namespace {

/// "1:2:12.5" or "1:2:12.5:0.05".
std::optional<KnownDistance> distance_from(const std::string& text) {
  std::vector<double> numbers;
  const char *at = text.data(), *end = at + text.size();
  while (at <= end) {
    double value = 0.0;
    const auto [next, error] = std::from_chars(at, end, value);
    if (error != std::errc{} || (next != end && *next != ':')) return std::nullopt;
    numbers.push_back(value);
    at = next + 1;
  }
  if (numbers.size() < 3 || numbers.size() > 4 || !(numbers[2] > 0.0) || numbers[0] == numbers[1]) return std::nullopt;
  if (numbers.size() == 4 && !(numbers[3] > 0.0)) return std::nullopt;
  return KnownDistance{static_cast<int>(numbers[0]), static_cast<int>(numbers[1]), numbers[2],
                       numbers.size() == 4 ? numbers[3] : 0.0};
}

TextCode distance_code(std::optional<KnownDistance>& distance) {
  TextCode code;
  code.read = [&distance](const std::string& text) -> std::string {
    const auto read = distance_from(text);
    if (!read) return "'" + text + "' is not HEAD:HEAD:METRES[:SIGMA], for example 1:2:12.5";
    distance = read;
    return "";
  };
  code.write = [&distance]() -> std::string {
    if (!distance) return "";
    const std::string sigma = distance->sigma_m > 0.0 ? fmt::format(":{}", distance->sigma_m) : "";
    return fmt::format("{}:{}:{}", distance->first, distance->second, distance->distance_m) + sigma;
  };
  return code;
}

bool is_length(double value) { return value > 0.0 && std::isfinite(value); }

}  // namespace

FieldList fields_of(MovingTargetConfig& config) {
  const std::string group = "Cameras that do not rotate";
  return {{.name = "clocks_s",
           .value = &config.clock_search_s,
           .help = "Maximum offset between the cameras' clocks, which are then estimated [s]; 0: one common clock",
           .limits = {.min = 0.0, .max = 3600.0},
           .form = "SECONDS",
           .group = group},
          {.name = "distance",
           .value = distance_code(config.distance),
           .help = "Known distance between the cameras of two heads [m], and its σ: 1:2:12.5[:0.05]",
           .form = "HEAD:HEAD:M[:M]",
           .group = group},
          {.name = "sigma_px",
           .value = &config.sigma_px,
           .help = "σ of a coordinate of an observation [px] (default: estimated from the residuals)",
           .limits = {.min = 0.0, .is_above_min = true},
           .option = "--sigma-px",
           .group = group}};
}

std::vector<std::string> faults(MovingTargetConfig config) {
  std::vector<std::string> found = faults_of(fields_of(config));
  const std::optional<KnownDistance>& known = config.distance;
  if (known && (!is_length(known->distance_m) || known->first == known->second)) {
    found.emplace_back("--distance: of two different heads, above 0");
  } else if (known && known->sigma_m != 0.0 && !is_length(known->sigma_m)) {
    found.emplace_back("--distance: its σ is not above 0");
  }
  return found;
}

}  // namespace alidade
