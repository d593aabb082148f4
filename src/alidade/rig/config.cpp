#include "alidade/rig/config.h"

#include <utility>

#include "alidade/board/dictionary.h"

namespace alidade {
namespace {

using Freedom = std::pair<const char*, bool RigConfig::*>;
constexpr Freedom freedoms[] = {{"scale", &RigConfig::estimate_scales},
                                {"once", &RigConfig::estimate_once},
                                {"backlash", &RigConfig::estimate_backlash},
                                {"focal", &RigConfig::estimate_focal},
                                {"centre", &RigConfig::estimate_centre}};

/// "scale,once": replaces what was to be estimated. What is wrong with it, else "".
std::string read_freedoms(const std::string& text, RigConfig& config) {
  config.estimate_by_need = text == "auto";
  for (const auto& [word, is_free] : freedoms) config.*is_free = false;
  if (text == "auto" || text == "none") return "";
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string part = text.substr(begin, end - begin);
    begin = end + 1;
    if (part == "auto" || part == "none") return "'" + part + "' excludes the others";
    bool is_known = false;
    for (const auto& [word, is_free] : freedoms) {
      if (part != word) continue;
      is_known = config.*is_free = true;
    }
    if (!is_known) return "'" + part + "' is not one of auto, none, scale, once, backlash, focal, centre";
  }
  return "";
}

TextCode freedoms_code(RigConfig& config) {
  TextCode code;
  code.read = [&config](const std::string& text) { return read_freedoms(text, config); };
  code.write = [&config] {
    std::string text;
    for (const auto& [word, is_free] : freedoms)
      if (config.*is_free) text += (text.empty() ? "" : ",") + std::string(word);
    return config.estimate_by_need ? "auto" : text.empty() ? "none" : text;
  };
  code.words = {"auto", "none"};
  for (const auto& [word, is_free] : freedoms) code.words.emplace_back(word);
  code.num_parts = 0;  // any number
  return code;
}

}  // namespace

FieldList fields_of(RigConfig& config) {
  constexpr Limits positive{.min = 0.0, .is_above_min = true};
  static const WordList<bool> rules = {{true, "drop"}, {false, "keep"}};
  return {
      {.name = "sigma_px",
       .value = &config.sigma_px,
       .help = "σ of a corner's coordinate [px] (default: estimated from the residuals)",
       .limits = positive,
       .option = "--sigma-px"},
      {.name = "sigma_angle_rad",
       .value = &config.sigma_encoder_rad,
       .help = "σ of an encoder reading [rad] (default: estimated from the residuals)",
       .limits = positive},
      {.name = "sigma_square_m",
       .value = &config.sigma_square_m,
       .help = "σ of the side of a square [m], included in the result's σ",
       .limits = positive},
      {.name = "sigma_scale",
       .value = &config.sigma_scale,
       .help = "Relative σ of the encoder scales (0.001: 0.1 %), included as well",
       .limits = positive},
      {.name = "sigma_within_turn_rad",
       .value = &config.sigma_within_turn_rad,
       .help = "σ of an encoder's error within a revolution [rad], which changes its scale over part of one; included "
               "in addition to --sigma-scale; 0: none",
       .limits = {.min = 0.0, .max = 0.1},
       .option = "--sigma-within-turn"},
      {.name = "estimate",
       .value = freedoms_code(config),
       .help =
           "auto: what the residuals indicate, and scales that are not given; none; or any of scale, once (encoder "
           "error with one period per revolution), backlash (views in the order taken), focal, centre (of each lens)"},
      {.name = "scales",
       .value = &config.estimate_scales,
       .help = "Also estimate the scale of each encoder (same as --estimate scale)"},
      {.name = "outliers",
       .value = words_code(config.reject_outliers, rules),
       .help = "drop: reject views that contradict the others, naming each; keep"}};
}

std::vector<std::string> faults(RigConfig config) {
  std::vector<std::string> found = faults_of(fields_of(config));
  if (config.estimate_scales && config.sigma_scale) {
    found.emplace_back("scales that are estimated have no --sigma-scale; give one of them");
  }
  if (!config.board) {
    found.emplace_back("--board is required (or --moving-target, for cameras that do not rotate)");
  } else if (const std::string of_board = fault(*config.board); !of_board.empty()) {
    found.push_back(of_board);
  }
  return found;
}

}  // namespace alidade
