#include "alidade/track/config.h"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>

#include "alidade/estimation/config_error.h"

namespace alidade {
namespace {

const WordList<TrackMethod>& track_method_words() {
  static const WordList<TrackMethod> words = {
      {TrackMethod::cv, "cv"},   {TrackMethod::singer, "singer"},       {TrackMethod::turn, "turn"},
      {TrackMethod::imm, "imm"}, {TrackMethod::ballistic, "ballistic"}, {TrackMethod::xiahou2015, "xiahou2015"}};
  return words;
}

TextCode gravity_code(std::optional<Eigen::Vector3d>& vector) {
  const auto values = [&vector] {
    return vector ? std::vector<double>(vector->begin(), vector->end()) : std::vector<double>();
  };
  return numbers_code(3, values, [&vector](const std::vector<double>& xyz) { vector = Eigen::Vector3d(xyz.data()); });
}

constexpr Limits positive{.min = 0.0, .max = 1e6, .is_above_min = true};

FieldList model_fields(TrackConfig& config) {
  return {
      {.name = "method",
       .value = words_code(config.method, track_method_words()),
       .help = "Motion model of the target: cv (constant velocity), singer, turn, imm (quiet, agile or falling), "
               "ballistic (free fall); or the filter of xiahou2015",
       .old_options = {"--motion"}},
      {.name = "gravity_m_s2",
       .value = gravity_code(config.gravity_m_s2),
       .help = "With ballistic and imm: gravity in the rig's world frame [m/s2] (default: 0 9.80665 0, the first "
               "camera level)",
       .form = "X,Y,Z"},
      {.name = "corrected",
       .value = &config.corrected,
       .help = "With xiahou2015: correct the paper's formulas for pixels and mounting (default: as printed)"},
      {.name = "predict_s",
       .value = &config.predict_s,
       .help = "Output predictions this far ahead of each event [s]",
       .limits = positive},
      {.name = "smooth_s",
       .value = &config.smooth_s,
       .help = "Also write smoothed.csv: the path smoothed with observations up to this much later [s]; not with imm",
       .limits = {0.01, 2.0}},
  };
}

FieldList sigma_fields(TrackConfig& config) {
  return {
      {.name = "sigma_a_m_s2",
       .value = &config.sigma_a_m_s2,
       .help = "σ of the target's acceleration [m/s2] (default: estimated from the innovations)",
       .limits = positive},
      {.name = "sigma_px",
       .value = &config.sigma_px,
       .help = "σ of the target's pixel coordinates [px] (default: estimated from the innovations, or 0.5 if they "
               "agree with it)",
       .limits = positive,
       .option = "--sigma-px"},
      {.name = "sigma_clock_s",
       .value = &config.sigma_clock_s,
       .help = "σ of the offset between a head's clock and its images, and between its angles and images [s], included "
               "in every σ (default: exact)",
       .limits = positive},
      {.name = "sigma_angle_rad",
       .value = &config.sigma_angle_rad,
       .help = "σ of an encoder for which the rig gives none [rad]",
       .limits = positive},
  };
}

FieldList range_fields(TrackConfig& config) {
  return {
      {.name = "min_depth_m", .value = &config.min_depth_m, .help = "Minimum working range [m]", .limits = positive},
      {.name = "max_depth_m", .value = &config.max_depth_m, .help = "Maximum working range [m]", .limits = positive},
      {.name = "keep_rows",
       .value = &config.keep_rows,
       .help = "Rows from standard input: minimum number of latest rows that the final result covers; at most twice as "
               "many",
       .limits = {.min = 100, .max = 1e9}}};
}

}  // namespace

FieldList fields_of(TrackConfig& config) {
  FieldList fields = model_fields(config);
  for (const FieldList& more : {sigma_fields(config), range_fields(config)})
    fields.insert(fields.end(), more.begin(), more.end());
  return fields;
}

void require_sense(TrackConfig config) {
  std::vector<std::string> found = faults_of(fields_of(config));
  const TrackMethod method = config.method;
  const bool falls = method == TrackMethod::ballistic || method == TrackMethod::imm;
  if (method < TrackMethod::cv || method > TrackMethod::xiahou2015) found.emplace_back("method is none of the enum");
  if (config.gravity_m_s2 && !falls) found.emplace_back("--gravity: only with --method ballistic or imm");
  if (config.gravity_m_s2 && !config.gravity_m_s2->allFinite())
    found.emplace_back("gravity_m_s2 is not three finite numbers");
  if (config.corrected && method != TrackMethod::xiahou2015)
    found.emplace_back("--corrected: only with --method xiahou2015");
  if (!(config.min_depth_m < config.max_depth_m)) found.emplace_back("--min-depth: is not below --max-depth");
  if (config.smooth_s && (method == TrackMethod::imm || method == TrackMethod::xiahou2015))
    found.push_back("--smooth: not for --method " + words_code(config.method, track_method_words()).write());
  if (!found.empty()) throw ConfigError(fmt::format("{}", fmt::join(found, "; ")));
}

}  // namespace alidade
