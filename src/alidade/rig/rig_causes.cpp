#include "alidade/rig/rig_causes.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "alidade/geometry/decompositions.h"
#include "alidade/rig/checks/board_print.h"
#include "alidade/rig/checks/moved_boards.h"
#include "alidade/rig/checks/rig_score.h"

namespace alidade {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index tested_a_head = 26;

/// Something that could be free: its columns among all that are tested.
struct Tested {
  std::string name, unit;
  std::vector<Index> places;
  std::vector<std::string> names = {};  ///< One per column, where each has one.
  double worst = 1.0;  ///< σ of its size beyond which the views do not determine it: 5σ would be implausible.
};

/// Indices of a head's columns: lens, then for each axis scale, one period, two periods, backlash; the drifts of the
/// base's position and rotation, and of each axis' zero.
constexpr Index column_of_axis(int axis) { return 3 + 6 * axis; }
constexpr Index base_drift_column = 15, zero_drift_column = 21, distortion_column = 23, fy_column = 24,
                focal_drift_column = 25;

/// One by one: of these only what is fixed.
std::vector<Tested> single_tests(const RigProblem& problem, const RigState& state) {
  std::vector<Tested> all;
  for (std::size_t h = 0; h < state.heads.size(); ++h) {
    const std::string head = "head" + std::to_string(state.heads[h].head.id) + ".";
    const Index first = tested_a_head * static_cast<Index>(h);
    const auto add = [&](const std::string& name, const char* unit, int param, std::vector<Index> places) {
      const double worst = std::string_view(unit) == "px" ? 50.0 : 0.05;
      if (param >= 0 && problem.is_free(h, param)) return;
      for (Index& place : places) place += first;
      all.push_back({head + name, unit, std::move(places), {head + name}, worst});
    };
    add("camera.fx", "px", focal_param, {0});
    add("camera.cx", "px", centre_x_param, {1});
    add("camera.cy", "px", centre_y_param, {2});
    add("camera.fy", "px", -1, {fy_column});
    add("camera.k1", "", -1, {distortion_column});
    add(focal_drift_name, "px", -1, {focal_drift_column});
    for (const int axis : {0, 1}) {
      const std::string name = axis == 0 ? "pan" : "tilt";
      const Index at = column_of_axis(axis);
      add(name + "_scale", "", pan_scale_param + axis, {at});
      add(name + " once a turn", "rad", pan_cos_param + 2 * axis, {at + 1, at + 2});
      add(name + " twice a turn", "rad", -1, {at + 3, at + 4});
      add(name + " backlash", "rad", pan_backlash_param + axis, {at + 5});
      add(name + " zero drift", "rad", -1, {zero_drift_column + axis});
    }
    add("position drift", "m", -1, {base_drift_column, base_drift_column + 1, base_drift_column + 2});
    add("rotation drift", "rad", -1, {base_drift_column + 3, base_drift_column + 4, base_drift_column + 5});
  }
  return all;
}

/// And what all axes, or all lenses, have alike: each alone explains only its part of the residuals.
std::vector<Tested> tested_of(const RigProblem& problem, const RigState& state) {
  std::vector<Tested> all = single_tests(problem, state);
  const std::size_t num_single = all.size();
  for (const auto& [ending, name] : {std::pair{"_scale", "scales"},
                                     {"camera.k1", "camera.k1"},
                                     {" once a turn", "once a turn"},
                                     {" backlash", "backlash"},
                                     {"camera.fx", "camera.fx"},
                                     {"camera.c", "centre"}}) {
    Tested joint{std::string("all ") + name, "", {}, {}, 1.0};
    int num = 0;
    for (std::size_t i = 0; i < num_single; ++i) {
      const Tested& one = all[i];
      if (!one.name.ends_with(ending) && !(name == std::string_view("centre") && one.name.ends_with("camera.cx")) &&
          !(name == std::string_view("centre") && one.name.ends_with("camera.cy")))
        continue;
      joint.unit = one.unit;
      joint.worst = one.worst;
      joint.places.insert(joint.places.end(), one.places.begin(), one.places.end());
      joint.names.insert(joint.names.end(), one.names.begin(), one.names.end());
      ++num;
    }
    if (num > 1) all.push_back(std::move(joint));
  }
  return all;
}

/// Derivatives of a view's whitened residuals by what is tested of its head.
MatrixXd tested_columns(const RigProblem& problem, const RigState& state, std::size_t v) {
  const GivenColumns given = given_columns(problem, state, v);
  const VectorXd lens = params(state.heads[problem.views[v].head].camera.lens);
  MatrixXd D(given.square.size(), tested_a_head);
  // From −½ to ½ over the table: what drifts does so by as much as its size; a step half-way is nearly as visible.
  const double time = (static_cast<double>(v) + 0.5) / static_cast<double>(problem.views.size()) - 0.5;
  D.col(0) = given.lens.col(0) + lens[1] / lens[0] * given.lens.col(1);
  D.col(1) = given.lens.col(2);
  D.col(2) = given.lens.col(3);
  for (const int axis : {0, 1}) {
    const double reading_rad = problem.views[v].view->pan_tilt_rad[axis];
    const Index at = column_of_axis(axis);
    D.col(at) = axis == 0 ? given.pan : given.tilt;
    for (const int turns : {1, 2}) {
      D.col(at + 2 * turns - 1) = std::cos(turns * reading_rad) * given.readings.col(axis);
      D.col(at + 2 * turns) = std::sin(turns * reading_rad) * given.readings.col(axis);
    }
    D.col(at + 5) = -problem.views[v].travel[axis] * given.readings.col(axis);
    D.col(zero_drift_column + axis) = time * given.readings.col(axis);
  }
  D.col(distortion_column) = given.distortion;
  D.middleCols<6>(base_drift_column) = time * given.base;
  D.col(fy_column) = given.lens.col(1);
  D.col(focal_drift_column) = time * D.col(0);
  return D;
}

/// σ with which a scale was given; none: as if exact. What is given of lenses comes with the covariance of their files.
double given_sigma(const std::vector<Assumption>& assumed, const std::string& name) {
  const auto what = std::ranges::find(assumed, name, &Assumption::name);
  return name.ends_with("_scale") && what != assumed.end() ? what->sigma.value_or(0.0) : 0.0;
}

/// One for each of its columns; what one name has two of (amplitudes) is never given.
VectorXd given_sigmas(const std::vector<Assumption>& assumed, const Tested& tested) {
  VectorXd sigmas = VectorXd::Zero(static_cast<Index>(tested.places.size()));
  if (tested.names.size() != tested.places.size()) return sigmas;
  for (std::size_t k = 0; k < tested.names.size(); ++k)
    sigmas[static_cast<Index>(k)] = given_sigma(assumed, tested.names[k]);
  return sigmas;
}

/// What may be there beside the noise that such a score has anyway: of 40 that are tested, one exceeds it.
VectorXd unsettled(const IndicatedChange& asked, double inflation) {
  constexpr double by_chance = 2.2;
  const double share = 1.0 - by_chance * by_chance * inflation / (asked.sigmas * asked.sigmas);
  return std::sqrt(std::max(0.0, share)) * asked.moves;
}

}  // namespace

RigCauses rig_causes(const RigProblem& problem, const SolvedRig& solved, const MatrixXd& cov,
                     const std::vector<double>& weights, const std::vector<Assumption>& assumed,
                     const MatrixXd& cov_lenses, double num_given, double inflation) {
  const auto num = tested_a_head * static_cast<Index>(solved.state.heads.size());
  const RigScore score = rig_score(problem, solved, cov, weights, num, [&](std::size_t v) {
    const Index first = tested_a_head * static_cast<Index>(problem.views[v].head);
    return std::optional<TestedColumns>({first, tested_columns(problem, solved.state, v)});
  });
  std::vector<RigCause> causes;
  VectorXd moves = VectorXd::Zero(cov.rows());
  double most = 0.0;
  const auto consider = [&](const IndicatedChange& asked) {
    const VectorXd by = unsettled(asked, inflation);
    if (const double squared = by.dot(solve_symmetric(cov, by)); squared > most) moves = by, most = squared;
  };
  for (const Tested& tested : tested_of(problem, solved.state)) {
    const auto asked = score.asked(tested.places, tested.worst, given_sigmas(assumed, tested), cov_lenses, num_given);
    if (!asked) continue;
    const double size = asked->size.size() == 1 ? asked->size[0] : asked->size.norm();
    causes.push_back({tested.name, size, tested.unit, asked->sigmas});
    consider(*asked);
  }
  if (const auto moved = moved_boards(problem, solved, cov, weights, cov_lenses, num_given)) causes.push_back(*moved);
  for (RigCause& cause : board_print(problem, solved, cov, weights, cov_lenses, num_given))
    causes.push_back(std::move(cause));
  std::ranges::sort(causes, std::greater{}, &RigCause::rank);
  return {std::move(causes), std::move(moves)};
}

}  // namespace alidade
