#include "alidade/rig/checks/moved_boards.h"

#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <vector>

#include "alidade/rig/checks/rig_score.h"

namespace alidade {
namespace {

using Eigen::Index;

using Displaced = std::map<std::pair<std::size_t, std::size_t>, Index>;  // board, head: its first column

/// Each shared board in the views of each head but the first.
Displaced displaced_boards(const RigProblem& problem, std::span<const double> weights) {
  std::map<std::size_t, std::set<std::size_t>> heads_of;  // a board
  for (std::size_t v = 0; v < problem.views.size(); ++v)
    if (weights[v] > 0.0) heads_of[problem.views[v].board].insert(problem.views[v].head);
  std::erase_if(heads_of, [](const auto& one) { return one.second.size() < 2; });
  std::size_t num = 0;
  for (const auto& [board, heads] : heads_of) num += heads.size() - 1;
  constexpr std::size_t most = 100;  // the test's cost is cubic in them
  const std::size_t stride = (num + most - 1) / most;
  Displaced columns;
  std::size_t index = 0;
  for (const auto& [board, heads] : heads_of) {
    if (index++ % stride != 0) continue;
    for (auto head = std::next(heads.begin()); head != heads.end(); ++head)
      columns.emplace(std::pair(board, *head), 3 * static_cast<Index>(columns.size()));
  }
  return columns;
}

}  // namespace

std::optional<RigCause> moved_boards(const RigProblem& problem, const SolvedRig& solved, const Eigen::MatrixXd& cov,
                                     std::span<const double> weights, const Eigen::MatrixXd& cov_lenses,
                                     double num_given) {
  const Displaced columns = displaced_boards(problem, weights);
  if (columns.size() < 2) return std::nullopt;
  const Index num = 3 * static_cast<Index>(columns.size());
  const RigScore score =
      rig_score(problem, solved, cov, weights, num, [&](std::size_t v) -> std::optional<TestedColumns> {
        const auto displaced = columns.find({problem.views[v].board, problem.views[v].head});
        const auto at = view_residuals(problem, solved.state, v);
        if (displaced == columns.end() || !at) return std::nullopt;
        return TestedColumns{displaced->second, at->J_board.leftCols<3>()};
      });
  std::vector<Index> places(static_cast<std::size_t>(num));
  std::iota(places.begin(), places.end(), Index{0});
  constexpr double worst_m = 0.05;
  const auto asked = score.asked(places, worst_m, Eigen::VectorXd::Zero(num), cov_lenses, num_given);
  if (!asked) return std::nullopt;
  // Beyond what noise makes of boards that stand.
  const double sum_m2 = asked->size.squaredNorm() - asked->variance.sum();
  if (!(sum_m2 > 0.0)) return std::nullopt;  // whatever the residuals indicate, boards stand
  const double size_m = std::sqrt(sum_m2 / static_cast<double>(columns.size()));
  return RigCause{moved_boards_name, size_m, "m", asked->sigmas};
}

}  // namespace alidade
