#include "alidade/rangefinder/config.h"

#include <cmath>

#include "alidade/board/dictionary.h"

namespace alidade {
namespace {

/// Whether outliers are rejected, in words.
TextCode outliers_code(bool& rejects) {
  static const WordList<bool> words = {{true, "drop"}, {false, "keep"}};
  return words_code(rejects, words);
}

FieldList sigma_fields(RangefinderConfig& config) {
  constexpr Limits positive{.min = 0.0, .is_above_min = true}, share{.min = 0.0, .max = 1.0};
  return {{.name = "sigma_px",
           .value = &config.sigma_spot_px,
           .help = "σ of a spot's coordinate [px] (default: from the photo, else estimated from the residuals)",
           .limits = positive,
           .option = "--sigma-px"},
          {.name = "sigma_range_m",
           .value = &config.sigma_range_m,
           .help = "σ of a reading [m] (default: estimated from the residuals)",
           .limits = positive,
           .option = "--sigma-range-m"},
          {.name = "sigma_square_m",
           .value = &config.sigma_square_m,
           .help = "σ of the side of the board's squares [m]; 0: exact",
           .limits = share},
          {.name = "sigma_flat_m",
           .value = &config.sigma_flat_m,
           .help = "σ of the offset of the surface hit by the beam from the plane of the corners, for example of a "
                   "sheet in front of the print [m]; 0: exact (default: only what the shots show)",
           .limits = share,
           .option = "--sigma-flat"},
          {.name = "sigma_scale",
           .value = &config.sigma_scale,
           .help = "σ of the scale of the readings, then fixed at 1; 0: exact (default: estimated if it matters and "
                   "the shots determine it)",
           .limits = share},
          {.name = "sigma_range_per_m",
           .value = &config.sigma_range_per_m,
           .help = "Increase of a reading's σ per metre of range [m/m]",
           .limits = positive,
           .option = "--sigma-range-per-m"},
          {.name = "sigma_incidence_m",
           .value = &config.sigma_incidence_m,
           .help = "Contribution to a reading's σ per tan(angle of incidence), added in quadrature [m]",
           .limits = positive,
           .option = "--sigma-incidence-m"}};
}

}  // namespace

std::optional<RangeNoise> RangefinderConfig::range_noise() const {
  if (!sigma_range_m) return std::nullopt;
  return RangeNoise{*sigma_range_m, sigma_range_per_m.value_or(0.0), sigma_incidence_m.value_or(0.0)};
}

void RangefinderConfig::set_range_noise(const RangeNoise& noise) {
  sigma_range_m = noise.sigma_m;
  sigma_range_per_m = noise.per_m > 0.0 ? std::optional(noise.per_m) : std::nullopt;
  sigma_incidence_m = noise.incidence_m > 0.0 ? std::optional(noise.incidence_m) : std::nullopt;
}

const WordList<RangefinderMethod>& rangefinder_method_words() {
  static const WordList<RangefinderMethod> words = {
      {RangefinderMethod::joint, "joint"}, {RangefinderMethod::spot, "spot"}, {RangefinderMethod::plane, "plane"}};
  return words;
}

FieldList fields_of(RangefinderConfig& config) {
  static const WordList<Refine> parts = {{Refine::all, "all"}, {Refine::beam, "beam"}};
  static const WordList<SpotColour> colours = {{SpotColour::automatic, "auto"},
                                               {SpotColour::red, "red"},
                                               {SpotColour::green, "green"},
                                               {SpotColour::bright, "bright"}};
  FieldList fields = {
      {.name = "method",
       .value = words_code(config.method, rangefinder_method_words()),
       .help = "joint: all measurements of each shot; spot: needs no board; plane: needs no visible spot"},
      {.name = "refine",
       .value = words_code(config.refine, parts),
       .help = "all: refine lens (within its covariance), boards and beam jointly; beam: lens and boards fixed"},
      {.name = "spot",
       .value = words_code(config.spot, colours),
       .help = "Colour of the laser: auto, red, green or bright (for grey photos)"},
      {.name = "scale",
       .value = &config.estimate_scale,
       .help = "Also estimate the scale of the readings (not possible with spots alone)"}};
  for (Field& field : sigma_fields(config)) fields.push_back(std::move(field));
  fields.push_back({.name = "outliers",
                    .value = outliers_code(config.reject_outliers),
                    .help = "drop: reject outlier shots, naming each; keep"});
  return fields;
}

std::vector<std::string> faults(RangefinderConfig config) {
  std::vector<std::string> found = faults_of(fields_of(config));
  if (config.estimate_scale && config.sigma_scale) {
    found.emplace_back("--scale estimates what --sigma-scale gives; give one of them");
  }
  if (config.sigma_square_m && !config.board) found.emplace_back("--sigma-square needs --board and --square");
  if (!config.sigma_range_m && (config.sigma_range_per_m || config.sigma_incidence_m)) {
    found.emplace_back("--sigma-range-per-m and --sigma-incidence-m add to --sigma-range-m; give that too");
  }
  if (config.sigma_corner_px && !(*config.sigma_corner_px > 0.0 && std::isfinite(*config.sigma_corner_px))) {
    found.emplace_back("sigma_corner_px is not above 0");
  }
  if (!(config.outlier_sigmas > 0.0)) found.emplace_back("outlier_sigmas is not above 0");
  if (config.num_draws < 1 || config.max_iterations < 1) {
    found.emplace_back("num_draws and max_iterations must be 1 or more");
  }
  if (const std::string of_board = config.board ? fault(*config.board) : ""; !of_board.empty()) {
    found.push_back(of_board);
  }
  return found;
}

}  // namespace alidade
