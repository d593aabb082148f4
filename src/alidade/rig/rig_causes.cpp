#include "alidade/rig/rig_causes.h"

#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/rig/rig_clusters.h"

namespace alidade {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Something that could be free: its columns among all that are tested.
struct Tested {
  std::string name, unit;
  Index first = 0, num = 1;
};

std::vector<Tested> tested_of(const RigProblem& problem, const RigState& state) {
  std::vector<Tested> all;
  Index next = 0;
  const auto add = [&](const std::string& name, const char* unit, Index num) {
    all.push_back({name, unit, next, num});
    next += num;
  };
  for (std::size_t h = 0; h < state.heads.size(); ++h) {
    const std::string head = "head" + std::to_string(state.heads[h].head.id) + ".";
    add(head + "camera.fx", "px", 1);
    add(head + "camera.cx", "px", 1);
    add(head + "camera.cy", "px", 1);
    for (const int axis : {0, 1}) {
      const std::string name = head + (axis == 0 ? "pan" : "tilt");
      const bool is_free = std::ranges::find(problem.free[h], 17 + axis) != problem.free[h].end();
      add(is_free ? "" : name + "_scale", "", 1);
      add(name + " once a turn", "rad", 2);
      add(name + " twice a turn", "rad", 2);
    }
  }
  return all;
}

constexpr Index tested_a_head = 13;

/// Derivatives of a view's whitened residuals by what is tested of its head.
MatrixXd tested_columns(const RigProblem& problem, const RigState& state, std::size_t v) {
  const GivenColumns given = given_columns(problem, state, v);
  const VectorXd lens = params(state.heads[problem.views[v].head].camera.lens);
  MatrixXd D(given.square.size(), tested_a_head);
  D.col(0) = given.lens.col(0) + lens[1] / lens[0] * given.lens.col(1);
  D.col(1) = given.lens.col(2);
  D.col(2) = given.lens.col(3);
  for (const int axis : {0, 1}) {
    const double reading_rad = problem.views[v].view->pan_tilt_rad[axis];
    const Index at = 3 + 5 * axis;
    D.col(at) = axis == 0 ? given.pan : given.tilt;
    for (const int turns : {1, 2}) {
      D.col(at + 2 * turns - 1) = std::cos(turns * reading_rad) * given.readings.col(axis);
      D.col(at + 2 * turns) = std::sin(turns * reading_rad) * given.readings.col(axis);
    }
  }
  return D;
}

/// Score and information of all that is tested, everything else following.
struct Score {
  VectorXd s;
  MatrixXd I;
};

Score score_of(const RigProblem& problem, const SolvedRig& solved, const MatrixXd& cov,
               const std::vector<double>& weights) {
  const auto num = tested_a_head * static_cast<Index>(solved.state.heads.size());
  Score score{VectorXd::Zero(num), MatrixXd::Zero(num, num)};
  MatrixXd by_common = MatrixXd::Zero(cov.rows(), num);
  std::vector<MatrixXd> by_board(solved.state.world_from_board.size(), MatrixXd::Zero(6, num));
  for (std::size_t v = 0; v < problem.views.size(); ++v) {
    if (!(weights[v] > 0.0)) continue;
    const auto at = view_residuals(problem, solved.state, v);
    const auto equations = view_equations(problem, solved, v);
    if (!at || !equations) continue;
    const MatrixXd D = tested_columns(problem, solved.state, v);
    const Index first = tested_a_head * static_cast<Index>(problem.views[v].head);
    const MatrixXd by_correction = at->J_correction.transpose() * D;
    const Eigen::Matrix2d E = at->J_correction.transpose() * at->J_correction;
    score.s.segment(first, tested_a_head) += D.transpose() * at->r;
    score.I.block(first, first, tested_a_head, tested_a_head) +=
        D.transpose() * D - by_correction.transpose() * (E.inverse() * by_correction);
    const MatrixXd by_pose = equations->Q.transpose() * D;
    by_common.middleCols(first, tested_a_head) += equations->G.transpose() * by_pose;
    by_board[problem.views[v].board].middleCols(first, tested_a_head) += equations->K_board.transpose() * by_pose;
  }
  for (std::size_t b = 0; b < by_board.size(); ++b)
    if (!solved.system.boards[b].V.isZero(0.0))
      score.I -= by_board[b].transpose() * Ldlt(solved.system.boards[b].V).solve_each(by_board[b]);
  score.I -= by_common.transpose() * cov * by_common;
  return score;
}

/// σ with which it was given; none: as if exact.
double given_sigma(const std::vector<Assumption>& assumed, const std::string& name) {
  const std::string of_all = name.substr(name.find('.') + 1);  // one lens for all heads has no head's name
  for (const Assumption& what : assumed)
    if (what.name == name || what.name == of_all) return what.sigma.value_or(0.0);
  return 0.0;
}

}  // namespace

std::vector<RigCause> rig_causes(const RigProblem& problem, const SolvedRig& solved, const MatrixXd& cov,
                                 const std::vector<double>& weights, const std::vector<Assumption>& assumed) {
  constexpr double least_information = 1e-6;  // of a unit's own: what the rest can do as well is not asked for
  const Score score = score_of(problem, solved, cov, weights);
  std::vector<RigCause> causes;
  for (const Tested& tested : tested_of(problem, solved.state)) {
    if (tested.name.empty()) continue;
    const VectorXd s = score.s.segment(tested.first, tested.num);
    const double sigma = tested.num == 1 ? given_sigma(assumed, tested.name) : 0.0;
    const SymmetricEigen eigen = symmetric_eigen(score.I.block(tested.first, tested.first, tested.num, tested.num));
    double chi2 = 0.0;
    VectorXd size = VectorXd::Zero(tested.num);
    for (Index k = 0; k < tested.num; ++k) {
      if (!(eigen.values[k] > least_information)) continue;
      const double along = eigen.vectors.col(k).dot(s) / eigen.values[k];
      chi2 += along * along / (1.0 / eigen.values[k] + sigma * sigma);
      size -= along * eigen.vectors.col(k);
    }
    // Of two numbers χ² is one larger by chance alone.
    const double sigmas = std::sqrt(std::max(0.0, chi2 - static_cast<double>(tested.num - 1)));
    causes.push_back({tested.name, tested.num == 1 ? size[0] : size.norm(), tested.unit, sigmas});
  }
  std::ranges::sort(causes, std::greater{}, &RigCause::sigmas);
  return causes;
}

}  // namespace alidade
