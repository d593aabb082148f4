#include "alidade/rangefinder/solve/fixed_distortion.h"

#include <algorithm>
#include <array>
#include <string_view>

namespace alidade {
namespace {

/// What boards in shots separate, and how far lenses go. The tangential is nearly as a centre that lies aside, whose
/// error the file knows: it goes no farther than it does in lenses.
struct Distortion {
  std::string_view name;
  double wide;
};
constexpr std::array<Distortion, 4> distortions{{{"k1", 0.3}, {"k2", 0.3}, {"p1", 0.005}, {"p2", 0.005}}};

bool has_sigma(const Camera& camera, int parameter) {
  return parameter < camera.cov.rows() && camera.cov(parameter, parameter) > 0.0;
}

}  // namespace

std::vector<int> fixed_distortion(const Camera& camera, const std::vector<int>& free) {
  const std::vector<std::string> names = param_names(camera.lens);
  std::vector<int> held;
  for (const Distortion& one : distortions) {
    const auto at = static_cast<int>(std::ranges::find(names, one.name) - names.begin());
    const bool is_there = at < static_cast<int>(names.size());
    if (is_there && std::ranges::find(free, at) == free.end()) held.push_back(at);
  }
  return held;
}

Camera with_open_distortion(const Camera& camera) {
  Camera open = with_distortion(camera);
  if (open.cov.rows() != params(open.lens).size()) return open;  // nothing of it is known
  const std::vector<std::string> names = param_names(open.lens);
  for (const int parameter : fixed_distortion(open, {})) {
    if (has_sigma(open, parameter)) continue;
    const auto one = std::ranges::find(distortions, names[static_cast<std::size_t>(parameter)], &Distortion::name);
    open.cov(parameter, parameter) = one->wide * one->wide;
  }
  return open;
}

}  // namespace alidade
