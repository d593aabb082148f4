#include "alidade/calibrate/changes/rolling_shutter.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "alidade/calibrate/checks/view_scores.h"
#include "alidade/calibrate/solve/columns.h"
#include "alidade/calibrate/study.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t least_photos = 6;

/// A view's pixels by the lens' free parameters, by its pose, by what a photo may have of its own, and the residual.
struct ShearedView {
  MatrixXd lens, pose, motion, focal, centre;
  VectorXd residual;
};

std::optional<ShearedView> sheared_view(const BoardView& board_view, const Rigid3& cam_from_board,
                                        const PreparedLens& lens, const PointArrays& points,
                                        const std::vector<Index>& free, double height_px) {
  const ViewArrays corners = make_arrays(board_view);
  Columns columns;
  if (!fill_columns(lens, cam_from_board, points, corners, columns)) return std::nullopt;
  const auto rows = static_cast<Index>(columns.num_rows());
  const auto column = [&](Index c) { return Eigen::Map<const VectorXd>(columns[static_cast<int>(c)], rows); };
  ShearedView view{
      MatrixXd(rows, std::ssize(free)), MatrixXd(rows, 6), MatrixXd(rows, 4), MatrixXd(rows, 1), MatrixXd(rows, 2),
      column(Columns::residual)};
  for (Index i = 0; i < std::ssize(free); ++i) view.lens.col(i) = column(free[static_cast<std::size_t>(i)]);
  for (Index i = 0; i < 6; ++i) view.pose.col(i) = column(Columns::pose + i);
  const VectorXd values = params(lens.lens);
  view.focal.col(0) = values[0] * column(0) + values[1] * column(1);
  view.centre << column(2), column(3);
  VectorXd row = VectorXd::Zero(rows);
  for (std::size_t i = 0; i < corners.size(); ++i)
    row[static_cast<Index>(i)] = row[rows / 2 + static_cast<Index>(i)] = corners.v_px[i] / height_px - 0.5;
  constexpr Index about_normal = 5;
  view.motion << row.asDiagonal() * view.pose.leftCols(3), row.asDiagonal() * view.pose.col(about_normal);
  return view;
}

/// What is left of `right` beside the columns of `by`.
MatrixXd beside(const MatrixXd& by, const MatrixXd& right) {
  const VectorXd scale = by.colwise().norm().cwiseMax(1e-300).cwiseInverse();
  const MatrixXd unit = by * scale.asDiagonal();
  return right - unit * Ldlt(MatrixXd(unit.transpose() * unit)).solve_each(MatrixXd(unit.transpose() * right));
}

MatrixXd both(const MatrixXd& pose, const MatrixXd& own) {
  MatrixXd all(pose.rows(), pose.cols() + own.cols());
  all << pose, own;
  return all;
}

/// What lens, poses and a part that each photo has of its own leave of the residuals.
struct Left {
  double squares = 0.0, dof = 0.0;
  std::vector<double> of_view;  ///< The lens as it is.

  [[nodiscard]] double variance() const { return squares / dof; }
};

Left left_by(const std::vector<ShearedView>& views, MatrixXd ShearedView::*own, double num_corners) {
  const Index num = views.front().lens.cols();
  MatrixXd H = MatrixXd::Zero(num, num);
  VectorXd g = VectorXd::Zero(num);
  Left left{.dof = 2.0 * num_corners - static_cast<double>(num)};
  for (const ShearedView& view : views) {
    const MatrixXd by = own == nullptr ? view.pose : both(view.pose, view.*own);
    const MatrixXd all = beside(by, both(view.lens, view.residual));
    H += all.leftCols(num).transpose() * all.leftCols(num);
    g += all.leftCols(num).transpose() * all.col(num);
    left.of_view.push_back(all.col(num).squaredNorm());
    left.squares += left.of_view.back();
    left.dof -= static_cast<double>(by.cols());
  }
  const VectorXd scale = H.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const VectorXd scaled = scale.asDiagonal() * g;
  left.squares -= scaled.dot(Ldlt(scaled_by(scale, H)).solve(scaled));
  return left;
}

/// In which share of the photos the motion explains three times what chance would.
double share_that_moves(const Left& still, const Left& moving) {
  constexpr double beyond = 3.0 * 4.0;  // of a motion's four parameters
  double num = 0.0;
  for (std::size_t k = 0; k < still.of_view.size(); ++k)
    num += still.of_view[k] - moving.of_view[k] > beyond * moving.variance() ? 1.0 : 0.0;
  return num / static_cast<double>(still.of_view.size());
}

std::vector<ShearedView> sheared_views(std::span<const BoardView> used, const CalibrateReport& report,
                                       const std::vector<Index>& free) {
  const PreparedLens lens = prepare(report.camera.lens);
  const PointArrays points = make_arrays(report.board_points);
  std::vector<ShearedView> views;
  for (const ViewFit& fit : report.views) {
    if (!fit.used) continue;
    auto view = sheared_view(used[views.size()], fit.cam_from_board, lens, points, free, report.camera.height_px);
    if (!view) return {};
    views.push_back(*std::move(view));
  }
  return views;
}

}  // namespace

std::optional<ReadoutMotion> readout_motion(std::span<const BoardView> views, const CalibrateReport& report) {
  const std::vector<Index> free = split_of(report).free;
  const std::vector<BoardView> used = used_views(views, report, views.size());
  if (!is_central(report.camera.lens) || free.empty() || used.size() < least_photos) return std::nullopt;
  const std::vector<ShearedView> sheared = sheared_views(used, report, free);
  if (sheared.empty()) return std::nullopt;
  double num_corners = 0.0;
  for (const BoardView& view : used) num_corners += static_cast<double>(view.corners.size());
  const Left still = left_by(sheared, nullptr, num_corners),
             moving = left_by(sheared, &ShearedView::motion, num_corners);
  if (!(moving.dof > 0.0) || !(moving.squares > 0.0)) return std::nullopt;
  constexpr double explains = 0.5, clearly = 0.8, most_photos = 0.5;
  const double otherwise = std::min(left_by(sheared, &ShearedView::focal, num_corners).variance(),
                                    left_by(sheared, &ShearedView::centre, num_corners).variance());
  if (moving.variance() > explains * still.variance() || moving.variance() > clearly * otherwise) return std::nullopt;
  if (share_that_moves(still, moving) < most_photos) return std::nullopt;
  return ReadoutMotion{std::sqrt((still.squares - moving.squares) / num_corners), std::sqrt(still.variance()),
                       std::sqrt(moving.variance())};
}

void heed_readout_motion(const ReadoutMotion& motion, Verdict& verdict) {
  Check check{.name = "photo to photo",
              .state = State::care,
              .value = motion.before_px / motion.after_px,
              .limit = 1.4,
              .unit = "1"};
  check.figure = "photos";
  check.text =
      "each photo shears the board otherwise, by about " + text_of(motion.sheared_px, 2) +
      " px, as where board or camera moves while a rolling shutter reads the rows (boards that differ, or that bend, "
      "look alike): with a "
      "motion for each the corners fit to " +
      text_of(motion.after_px, 2) + " px a coordinate instead of " + text_of(motion.before_px, 2);
  const std::string remedy =
      "hold board and camera still for each photo, on a stand, and take the photos again, all of one stiff board";
  heed(check, remedy, verdict);
  verdict.sentence += "; " + check.text;
  verdict.to_add = remedy;
}

}  // namespace alidade
