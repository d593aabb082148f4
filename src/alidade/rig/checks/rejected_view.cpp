#include "alidade/rig/checks/rejected_view.h"

#include <cmath>
#include <cstdio>
#include <limits>
#include <vector>

#include "alidade/geometry/degree.h"

namespace alidade {
namespace {

/// χ² of a view read so, over the count of its residuals, its reading corrected to where it looks best; infinite where
/// a corner is not seen.
double mean_chi2_of(const Work& work, const RigState& state, const RigView& view) {
  RigProblem problem = work.problem;
  problem.views = {view};
  RigState of_view = state;
  of_view.corrections_rad = {Eigen::Vector2d::Zero()};
  double mean = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 4; ++i) {
    const auto at = view_residuals(problem, of_view, 0);
    if (!at) return std::numeric_limits<double>::infinity();
    mean = at->r.squaredNorm() / static_cast<double>(at->r.size());
    const Eigen::Matrix2d H = at->J_correction.transpose() * at->J_correction;
    of_view.corrections_rad[0] -= H.inverse() * (at->J_correction.transpose() * at->r);
  }
  return mean;
}

/// The row of a view read otherwise, and the one that fits best.
class RowReadings {
 public:
  RowReadings(const Work& work, const RigState& state, std::size_t view, double most)
      : work_(work), state_(state), view_(view), least_(most) {}

  void try_all() {
    try_corners();
    for (std::size_t head = 0; head < state_.heads.size(); ++head)
      if (head != own().head) try_row(*own().view, head, own().board, "fits head " + std::to_string(work_.ids[head]));
    for (std::size_t board = 0; board < work_.boards.size(); ++board)
      if (board != own().board)
        try_row(*own().view, own().head, board, "fits board " + std::to_string(work_.boards[board]));
    try_angles();
  }

  [[nodiscard]] const std::string& best() const { return best_; }

 private:
  [[nodiscard]] const RigView& own() const { return work_.problem.views[view_]; }

  void try_row(const HeadView& row, std::size_t head, std::size_t board, const std::string& words) {
    const double mean = mean_chi2_of(work_, state_, {&row, head, board, own().travel});
    if (mean < least_) least_ = mean, best_ = words;
  }

  void try_corners() {
    if (!half_turn_of(work_.problem.points_in_board)) return;
    HeadView row = *own().view;
    const int last = static_cast<int>(work_.problem.points_in_board.size()) - 1;
    for (Corner& corner : row.seen.corners) corner.index = last - corner.index;
    try_row(row, own().head, own().board, "corners numbered from the other end of the board");
  }

  void try_reading(const Eigen::Vector2d& reading_rad, const std::string& words) {
    HeadView row = *own().view;
    row.pan_tilt_rad = reading_rad;
    try_row(row, own().head, own().board, words);
  }

  void try_angles() {
    try_reading(own().view->pan_tilt_rad.reverse(), "fits with pan and tilt exchanged");
    for (const bool is_before : {true, false}) {
      const std::string whose = is_before ? " after" : " before";  // it has, if its own are in the row before, or after
      std::vector<std::size_t> others;                             // the next one of the table, and of its head
      for (std::size_t by = 1; by < work_.given.size() && others.size() < 2; ++by) {
        const std::size_t v = is_before ? view_ - by : view_ + by;
        if (is_before ? by > view_ : v >= work_.given.size()) break;
        const bool is_own = work_.problem.views[v].head == own().head;
        if (by == 1 || is_own) others.push_back(v);
        if (is_own) break;
      }
      for (const std::size_t v : others) try_reading(work_.given[v].pan_tilt_rad, "has the angles of the view" + whose);
    }
  }

  const Work& work_;
  const RigState& state_;
  std::size_t view_;
  double least_;
  std::string best_;
};

/// The RMS distance of the view's corners from where the rig puts them, its reading corrected as in the solve.
std::string corners_off(const Work& work, const RigState& state, std::size_t view) {
  const auto at = view_residuals(work.problem, state, view);
  if (!at) return "the rig does not put its corners into the image";
  const Eigen::Index num = at->r.size() - 2;  // behind them, the reading's
  const double rms_px = work.problem.sigma_px * std::sqrt(2.0 * at->r.head(num).squaredNorm() / double(num));
  return "its corners are " + text_of(rms_px, 2) + " px from where the rig puts them";
}

}  // namespace

Rejection rejection_of(const Work& work, const RigState& state, std::size_t view, double most) {
  const RigView& own = work.problem.views[view];
  if (!work.poses[view]) return {"outlier: its pixels do not fit", ""};
  RowReadings rows(work, state, view, most);
  rows.try_all();
  if (rows.best().starts_with("fits head ")) return {"outlier: it " + rows.best() + "; heads swapped?", rows.best()};
  if (rows.best().starts_with("corners "))
    return {"outlier: its corners are numbered from the other end of the board", rows.best()};
  if (!rows.best().empty()) return {"outlier: it " + rows.best(), rows.best()};
  const Rigid3& seen = work.poses[view]->pose.cam_from_board;
  const Rigid3 expected =
      cam_from_world(state.heads[own.head].head, work.given[view].pan_tilt_rad) * state.world_from_board[own.board];
  const double off_rad = expected.rotation.angularDistance(seen.rotation);
  const double off_m = (expected.translation - seen.translation).norm();
  std::string text = "outlier: " + corners_off(work, state, view);
  if (off_rad < 0.05 * degree && off_m < 5e-4) return {text, ""};  // the board is where it should be
  char board[96];
  std::snprintf(board, sizeof board, "; the board is %.1f° and %.0f mm from where this head's angles put it",
                off_rad / degree, 1e3 * off_m);
  return {text + board, ""};
}

}  // namespace alidade
