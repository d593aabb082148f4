#include "alidade/rig/checks/rig_score.h"

#include <utility>

#include "alidade/estimation/innovation.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/rig/rig_clusters.h"
#include "alidade/rig/rig_given.h"

namespace alidade {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

Index first_lens_param(const RigState& state, std::size_t head) {
  Index first = 0;
  for (std::size_t h = 0; h < head; ++h) first += params(state.heads[h].camera.lens).size();
  return first;
}

/// Sums over views. Beside what is tested the lenses, to whose errors the score responds.
class ScoreSums {
 public:
  ScoreSums(const RigProblem& problem, const SolvedRig& solved, Index num_free, Index num)
      : problem_(problem),
        solved_(solved),
        num_(num),
        num_lenses_(first_lens_param(solved.state, solved.state.heads.size())),
        by_common_(MatrixXd::Zero(num_free, num + num_lenses_)),
        by_board_(solved.state.world_from_board.size(), MatrixXd::Zero(6, num + num_lenses_)),
        score_{VectorXd::Zero(num), MatrixXd::Zero(num, num), MatrixXd::Zero(num, num_lenses_), {}} {}

  void add(std::size_t v, const std::optional<TestedColumns>& tested) {
    const auto at = view_residuals(problem_, solved_.state, v);
    const auto equations = view_equations(problem_, solved_, v);
    if (!at || !equations) return;
    const MatrixXd lens = given_columns(problem_, solved_.state, v).lens;
    const Index first_lens = first_lens_param(solved_.state, problem_.views[v].head);
    if (tested) {
      const MatrixXd& D = tested->D;
      const MatrixXd by_correction = at->J_correction.transpose() * D;
      const Eigen::Matrix2d E = at->J_correction.transpose() * at->J_correction;
      const MatrixXd followed = E.inverse() * by_correction;
      score_.s.segment(tested->first, D.cols()) += D.transpose() * at->r;
      score_.I.block(tested->first, tested->first, D.cols(), D.cols()) +=
          D.transpose() * D - by_correction.transpose() * followed;
      score_.by_lenses.block(tested->first, first_lens, D.cols(), lens.cols()) +=
          D.transpose() * lens - followed.transpose() * (at->J_correction.transpose() * lens);
      add_pose(v, *equations, tested->first, D);
    }
    add_pose(v, *equations, num_ + first_lens, lens);
  }

  RigScore with_all_following(const MatrixXd& cov) && {
    MatrixXd followed = by_common_.leftCols(num_).transpose() * cov * by_common_;
    for (std::size_t b = 0; b < by_board_.size(); ++b)
      if (!solved_.system.boards[b].V.isZero(0.0))
        followed += by_board_[b].leftCols(num_).transpose() * Ldlt(solved_.system.boards[b].V).solve_each(by_board_[b]);
    score_.I -= followed.leftCols(num_);
    score_.by_lenses -= followed.rightCols(num_lenses_);
    score_.moves = -cov * by_common_.leftCols(num_);
    return std::move(score_);
  }

 private:
  void add_pose(std::size_t v, const ViewEquations& equations, Index column, const MatrixXd& columns) {
    const MatrixXd by_pose = equations.Q.transpose() * columns;
    by_common_.middleCols(column, columns.cols()) += equations.G.transpose() * by_pose;
    by_board_[problem_.views[v].board].middleCols(column, columns.cols()) += equations.K_board.transpose() * by_pose;
  }

  const RigProblem& problem_;
  const SolvedRig& solved_;
  Index num_, num_lenses_;
  MatrixXd by_common_;
  std::vector<MatrixXd> by_board_;
  RigScore score_;
};

}  // namespace

std::optional<IndicatedChange> RigScore::asked(const std::vector<Index>& places, double worst, const VectorXd& given,
                                               const MatrixXd& cov_lenses, double num_given) const {
  const SymmetricEigen eigen = symmetric_eigen(MatrixXd(I(places, places)));
  const Index num = (eigen.values.array() * worst * worst > 1.0).count();  // the last ones
  if (num == 0) return std::nullopt;
  const MatrixXd V = eigen.vectors.rightCols(num);
  const VectorXd variances = eigen.values.tail(num).cwiseInverse();
  const VectorXd along = variances.cwiseProduct(V.transpose() * s(places));
  // By errors of the files, and of what itself was given.
  const MatrixXd moved = variances.asDiagonal() * V.transpose() * by_lenses(places, Eigen::all);
  const MatrixXd by_given = V.transpose() * given.asDiagonal();
  MatrixXd C = moved * cov_lenses * moved.transpose() + by_given * by_given.transpose();
  C.diagonal() += variances;
  const double chi2 = along.dot(solve_symmetric(C, along));
  const VectorXd size = -V * along;
  return IndicatedChange{size, V.cwiseAbs2() * variances, score_sigmas(chi2, static_cast<double>(num), num_given),
                         moves(Eigen::all, places) * size};
}

RigScore rig_score(const RigProblem& problem, const SolvedRig& solved, const MatrixXd& cov,
                   std::span<const double> weights, Index num,
                   const std::function<std::optional<TestedColumns>(std::size_t)>& columns) {
  ScoreSums sums(problem, solved, cov.rows(), num);
  for (std::size_t v = 0; v < problem.views.size(); ++v)
    if (weights[v] > 0.0) sums.add(v, columns(v));
  return std::move(sums).with_all_following(cov);
}

}  // namespace alidade
