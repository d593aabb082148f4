#include "alidade/calibrate/solve/port.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

namespace alidade {
namespace {

std::string with_decimals(double value, int decimals) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return text.data();
}

}  // namespace

CalibrateConfig with_port(CalibrateConfig config, const PortKnowledge& port) {
  constexpr double start_only = std::numeric_limits<double>::infinity();  // a prior of this σ says nothing
  config.model = FlatPort::name;
  const auto know = [&](const std::string& name, double value, bool held) {
    const auto is_named = [&](const Prior& prior) { return prior.name == name; };
    if (std::none_of(config.priors.begin(), config.priors.end(), is_named))
      config.priors.push_back({name, value, start_only});
    const bool fixed = std::find(config.fixed.begin(), config.fixed.end(), name) != config.fixed.end();
    if (held && !fixed) config.fixed.push_back(name);
  };
  if (port.air) {
    const std::vector<std::string> names = param_names(port.air->lens);
    const Eigen::VectorXd values = params(port.air->lens);
    for (std::size_t i = 0; i < Brown::param_names.size(); ++i) {  // a pinhole's parameters are the first of a brown's
      know(std::string(Brown::param_names[i]), i < names.size() ? values[static_cast<Eigen::Index>(i)] : 0.0, true);
    }
  }
  know("gap_m", port.gap_m, false);
  know("glass_m", port.glass_m.value_or(0.0), true);
  know("n_glass", port.n_glass, true);
  know("n_water", port.n_water, true);
  return config;
}

double largest_given_sigma(const std::string& name, double value, const Camera& camera) {
  if (name == "fx" || name == "fy") return 0.05 * value;
  if (name == "cx" || name == "cy") return 0.1 * std::max(camera.width_px, camera.height_px);
  // Of a port: 5 mm of gap and 1° of tilt are what decides whether a Brown lens would do.
  if (name == "gap_m" || name == "glass_m") return std::max(5e-3, 0.1 * value);
  if (name == "normal_x" || name == "normal_y") return 0.0175;
  if (name == "n_glass" || name == "n_water") return 0.02;
  return std::numeric_limits<double>::infinity();
}

std::string port_sentence(const PortResidual& residual) {
  std::string errors, ranges;
  for (const PortRange& at : residual.at) {
    errors += (errors.empty() ? "" : " / ") + with_decimals(at.rms_px, 2);
    ranges += (ranges.empty() ? "" : " / ") + with_decimals(at.range_m, at.range_m < 1.0 ? 1 : 0);
  }
  return "a brown lens fitted in this water, its viewpoint " + with_decimals(1e3 * residual.shift_m.norm(), 1) +
         " mm off, errs by " + errors + " px at " + ranges +
         " m: " + (residual.brown_is_enough ? "it is enough from 0.5 m on" : "use the flat_port camera");
}

}  // namespace alidade
