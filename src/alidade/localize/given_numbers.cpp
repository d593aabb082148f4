#include "alidade/localize/given_numbers.h"

#include <algorithm>
#include <cmath>

namespace alidade {
namespace {

constexpr std::array<std::string_view, 6> pose_numbers{"the position across (x)", "the position across (y)",
                                                       "the distance (z)",        "the rotation about x",
                                                       "the rotation about y",    "the rotation about z"};

/// Of a change along `direction`: how the path moves, and what the sights say.
GivenNumber given_number(std::string_view name, const Eigen::VectorXd& direction, const GivenSystem& system) {
  GivenNumber given{.name = name};
  for (std::size_t k = 0; k < system.J_pose.size(); ++k) {
    const Eigen::Vector<double, 6> move = system.J_pose[k] * direction;
    for (int i = 0; i < 6; ++i) {
      const double share = std::abs(move[i]) / std::sqrt(system.pose_cov[k](i, i));
      if (!(share > given.moves)) continue;
      given.moves = share;
      given.moved = pose_numbers[static_cast<std::size_t>(i)];
      given.moved_by = std::abs(move[i]);
    }
  }
  const Eigen::VectorXd informed = system.information * direction;
  const double information = direction.dot(informed), score = direction.dot(system.score);
  if (information > 0.0) {
    given.asked = score / information;
    given.z = score / std::sqrt(information + informed.dot(system.cov * informed));
  }
  return given;
}

}  // namespace

std::vector<GivenNumber> given_numbers(const GivenSystem& system) {
  const std::vector<std::string> names = param_names(system.camera.lens);
  const Eigen::VectorXd values = params(system.camera.lens);
  const auto num = static_cast<Eigen::Index>(system.lens_params.size());
  const auto place = [&](std::string_view name) -> Eigen::Index {
    for (Eigen::Index i = 0; i < num; ++i)
      if (names[static_cast<std::size_t>(system.lens_params[static_cast<std::size_t>(i)])] == name) return i;
    return -1;
  };
  const auto value_of = [&](Eigen::Index i) { return values[system.lens_params[static_cast<std::size_t>(i)]]; };
  const bool has_cov = system.camera.cov.size() > 0;
  std::vector<GivenNumber> all;
  const auto add = [&](std::string_view name, const Eigen::VectorXd& direction, std::optional<double> sigma) {
    all.push_back(given_number(name, direction, system));
    all.back().sigma = sigma;
  };
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(num + 1);
  const Eigen::Index fx = place("fx"), fy = place("fy");
  if (fx >= 0 && fy >= 0) {
    Eigen::VectorXd direction = none;
    direction[fx] = value_of(fx);
    direction[fy] = value_of(fy);
    add("focal length", direction,
        has_cov ? std::optional(std::sqrt(system.cov(fx, fx)) / value_of(fx)) : std::nullopt);
  }
  for (const auto& [param, name] : {std::pair{"cx", "centre u"}, std::pair{"cy", "centre v"}, std::pair{"k1", "k1"}}) {
    const Eigen::Index at = place(param);
    if (at < 0) continue;
    Eigen::VectorXd direction = none;
    direction[at] = 1.0;
    add(name, direction, has_cov ? std::optional(std::sqrt(system.cov(at, at))) : std::nullopt);
  }
  Eigen::VectorXd scale = none;
  scale[num] = 1.0;
  add("scale of the target", scale, std::sqrt(system.cov(num, num)));
  all.back().asked = all.back().z = 0.0;  // all may be larger: no sight tells
  return all;
}

}  // namespace alidade
