#include "alidade/calibrate/config.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

namespace alidade {
namespace {

const WordList<std::string>& models() {
  static const WordList<std::string> words = [] {
    WordList<std::string> list;
    for (const char* model : {"pinhole", "brown", "kannala_brandt", "flat_port"}) list.emplace_back(model, model);
    return list;
  }();
  return words;
}

bool is_number(const std::string& text, double& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size() && std::isfinite(value);
}

/// "fx=650:5": name, value, σ.
std::optional<Prior> parsed_prior(const std::string& text) {
  const auto equals = text.find('='), colon = text.find(':');
  if (equals == std::string::npos || colon == std::string::npos || colon < equals) return std::nullopt;
  Prior prior{.name = text.substr(0, equals)};
  const bool has_value = is_number(text.substr(equals + 1, colon - equals - 1), prior.value);
  return has_value && is_number(text.substr(colon + 1), prior.sigma) ? std::optional(prior) : std::nullopt;
}

/// "fx=650:5,cx=320:10".
TextCode priors_code(std::vector<Prior>& priors) {
  TextCode code;
  code.read = [&priors](const std::string& text) -> std::string {
    std::vector<Prior> read;
    for (std::size_t begin = 0; begin <= text.size();) {
      const std::size_t end = std::min(text.find(',', begin), text.size());
      const auto prior = parsed_prior(text.substr(begin, end - begin));
      if (!prior) return "'" + text.substr(begin, end - begin) + "' is not NAME=VALUE:SIGMA, for example fx=650:5";
      read.push_back(*prior);
      begin = end + 1;
    }
    priors = std::move(read);
    return "";
  };
  code.write = [&priors] {
    std::string text;
    for (const Prior& prior : priors) {
      text += fmt::format("{}{}={}:{}", text.empty() ? "" : ",", prior.name, prior.value, prior.sigma);
    }
    return text;
  };
  return code;
}

FieldList port_fields(PortKnowledge& port) {
  constexpr Limits length{0.0, 10.0}, index{1.0, 4.0};
  return {{.name = "gap_m",
           .value = &port.gap_m,
           .help = "flat_port: air gap between lens and glass, initial guess [m]",
           .limits = length},
          {.name = "glass_m",
           .value = &port.glass_m,
           .help = "flat_port: thickness of the glass, fixed [m]; required",
           .limits = length},
          {.name = "n_glass",
           .value = &port.n_glass,
           .help = "flat_port: refractive index of the glass, fixed",
           .limits = index},
          {.name = "n_water",
           .value = &port.n_water,
           .help = "flat_port: refractive index of the water, fixed (fresh 1.333, sea 1.34)",
           .limits = index}};
}

}  // namespace

const WordList<BoardShape>& shape_words() {
  static const WordList<BoardShape> words = {{BoardShape::flat, "flat"},
                                             {BoardShape::bow, "bow"},
                                             {BoardShape::free, "free"},
                                             {BoardShape::automatic, "auto"}};
  return words;
}

FieldList fields_of(CalibrateConfig& config) {
  static const WordList<OutlierRule> rules = {
      {OutlierRule::automatic, "auto"}, {OutlierRule::drop, "drop"}, {OutlierRule::keep, "keep"}};
  FieldList fields = {
      {.name = "model", .value = words_code(config.model, models()), .help = "Lens model"},
      {.name = "fixed",
       .value = &config.fixed,
       .help =
           "Parameters fixed at zero (cx, cy: at the image centre; with --prior: at its value), for example k3,p1,p2",
       .option = "--fix"},
      {.name = "free", .value = &config.free, .help = "Parameters to estimate that are otherwise fixed: skew"},
      {.name = "prior",
       .value = priors_code(config.priors),
       .help = "Prior on a parameter, NAME=VALUE:SIGMA, for example fx=650:5",
       .form = "NAME=VALUE:SIGMA,..."},
      {.name = "board_shape",
       .value = words_code(config.board_shape, shape_words()),
       .help = "flat, bow (2 parameters), free (every point), auto (bow or free if the photos show it)"},
      {.name = "outliers",
       .value = words_code(config.outliers, rules),
       .help = "drop: reject outlier corners, naming each; keep; auto: drop, but keep corners given without sigma"}};
  const FieldList port = port_fields(config.port);
  fields.insert(fields.end(), port.begin(), port.end());
  return fields;
}

}  // namespace alidade
