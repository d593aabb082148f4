#include "alidade/rig/rig_causes.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "alidade/estimation/innovation.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/rig/rig_clusters.h"

namespace alidade {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index tested_a_head = 24;

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
constexpr Index base_drift_column = 15, zero_drift_column = 21, distortion_column = 23;

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
    add("camera.k1", "", -1, {distortion_column});
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
  return D;
}

/// Score and information of all that is tested, everything else following.
struct Score {
  VectorXd s;
  MatrixXd I;
  MatrixXd by_lenses;  ///< Of it with the parameters of all heads' lenses.
};

Index num_lens_params(const RigState& state, std::size_t head) { return params(state.heads[head].camera.lens).size(); }

Index first_lens_param(const RigState& state, std::size_t head) {
  Index first = 0;
  for (std::size_t h = 0; h < head; ++h) first += num_lens_params(state, h);
  return first;
}

Score score_of(const RigProblem& problem, const SolvedRig& solved, const MatrixXd& cov,
               const std::vector<double>& weights) {
  const auto num = tested_a_head * static_cast<Index>(solved.state.heads.size());
  const Index num_lenses = first_lens_param(solved.state, solved.state.heads.size());
  Score score{VectorXd::Zero(num), MatrixXd::Zero(num, num), MatrixXd::Zero(num, num_lenses)};
  // Beside what is tested the lenses, to whose errors the score responds.
  MatrixXd by_common = MatrixXd::Zero(cov.rows(), num + num_lenses);
  std::vector<MatrixXd> by_board(solved.state.world_from_board.size(), MatrixXd::Zero(6, num + num_lenses));
  for (std::size_t v = 0; v < problem.views.size(); ++v) {
    if (!(weights[v] > 0.0)) continue;
    const auto at = view_residuals(problem, solved.state, v);
    const auto equations = view_equations(problem, solved, v);
    if (!at || !equations) continue;
    const MatrixXd D = tested_columns(problem, solved.state, v), lens = given_columns(problem, solved.state, v).lens;
    const Index first = tested_a_head * static_cast<Index>(problem.views[v].head);
    const MatrixXd by_correction = at->J_correction.transpose() * D;
    const Eigen::Matrix2d E = at->J_correction.transpose() * at->J_correction;
    score.s.segment(first, tested_a_head) += D.transpose() * at->r;
    score.I.block(first, first, tested_a_head, tested_a_head) +=
        D.transpose() * D - by_correction.transpose() * (E.inverse() * by_correction);
    const Index first_lens = first_lens_param(solved.state, problem.views[v].head);
    score.by_lenses.block(first, first_lens, tested_a_head, lens.cols()) +=
        D.transpose() * lens - by_correction.transpose() * (E.inverse() * (at->J_correction.transpose() * lens));
    const auto add_pose = [&](Index column, const MatrixXd& columns) {
      const MatrixXd by_pose = equations->Q.transpose() * columns;
      by_common.middleCols(column, columns.cols()) += equations->G.transpose() * by_pose;
      by_board[problem.views[v].board].middleCols(column, columns.cols()) += equations->K_board.transpose() * by_pose;
    };
    add_pose(first, D);
    add_pose(num + first_lens, lens);
  }
  MatrixXd followed = by_common.leftCols(num).transpose() * cov * by_common;
  for (std::size_t b = 0; b < by_board.size(); ++b)
    if (!solved.system.boards[b].V.isZero(0.0))
      followed += by_board[b].leftCols(num).transpose() * Ldlt(solved.system.boards[b].V).solve_each(by_board[b]);
  score.I -= followed.leftCols(num);
  score.by_lenses -= followed.rightCols(num_lenses);
  return score;
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

}  // namespace

std::vector<RigCause> rig_causes(const RigProblem& problem, const SolvedRig& solved, const MatrixXd& cov,
                                 const std::vector<double>& weights, const std::vector<Assumption>& assumed,
                                 const MatrixXd& cov_lenses, double num_given) {
  const Score score = score_of(problem, solved, cov, weights);
  std::vector<RigCause> causes;
  for (const Tested& tested : tested_of(problem, solved.state)) {
    const SymmetricEigen eigen = symmetric_eigen(MatrixXd(score.I(tested.places, tested.places)));
    const Index num = (eigen.values.array() * tested.worst * tested.worst > 1.0).count();  // the last ones
    if (num == 0) continue;
    const MatrixXd V = eigen.vectors.rightCols(num);
    const VectorXd variances = eigen.values.tail(num).cwiseInverse();
    const VectorXd along = variances.cwiseProduct(V.transpose() * score.s(tested.places));
    // By errors of the files, and of what itself was given.
    const MatrixXd moved = variances.asDiagonal() * V.transpose() * score.by_lenses(tested.places, Eigen::all);
    const MatrixXd given = V.transpose() * given_sigmas(assumed, tested).asDiagonal();
    MatrixXd C = moved * cov_lenses * moved.transpose() + given * given.transpose();
    C.diagonal() += variances;
    const double chi2 = along.dot(solve_symmetric(C, along));
    const VectorXd size = -V * along;
    causes.push_back({tested.name, size.size() == 1 ? size[0] : size.norm(), tested.unit,
                      score_sigmas(chi2, static_cast<double>(num), num_given)});
  }
  // What names one axis says more than what names all, where it explains nearly as much.
  std::ranges::sort(causes, std::greater{},
                    [](const RigCause& cause) { return cause.sigmas * (cause.name.starts_with("all ") ? 0.8 : 1.0); });
  return causes;
}

}  // namespace alidade
