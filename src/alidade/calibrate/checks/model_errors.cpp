#include "alidade/calibrate/checks/model_errors.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "alidade/calibrate/checks/judge.h"
#include "alidade/calibrate/checks/view_scores.h"
#include "alidade/calibrate/solve/columns.h"
#include "alidade/calibrate/study.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t least_views_of_modes = 6;
constexpr double included_sigmas = 3.0, proved_sigmas = 4.0;

/// A departure from the grid, displacements of all points, or from the lens model, those of all image points.
struct ErrorMode {
  enum class Kind { lengths, angle, spacing, radial, prism_x, prism_y };
  Kind kind = Kind::spacing;
  MatrixXd displacement = {};  ///< Of the print: 2 × points [m], of size 1.
  double largest_m = 0.0;      ///< Displacement of a point by size 1.

  [[nodiscard]] bool is_of_lens() const { return kind >= Kind::radial; }
};

/// Displacement in the image plane at unit focal length of what is seen at `point_in_cam`, by size 1: the radial term
/// that follows those of the model (pinhole k1, brown r⁹, kannala_brandt θ¹¹), or a thin prism, r².
Eigen::Vector2d displacement_of(ErrorMode::Kind kind, const Lens& lens, const Eigen::Vector3d& point_in_cam) {
  Eigen::Vector2d at = point_in_cam.head<2>() / point_in_cam.z();
  double power = std::holds_alternative<Calibrated<Pinhole>>(lens) ? 2.0 : 8.0;
  if (std::holds_alternative<Calibrated<KannalaBrandt>>(lens)) {
    const double radius = point_in_cam.head<2>().norm();
    at = point_in_cam.head<2>() / std::max(radius, 1e-12) * std::atan2(radius, point_in_cam.z());
    power = 10.0;
  }
  if (kind == ErrorMode::Kind::prism_x) return {at.squaredNorm(), 0.0};
  if (kind == ErrorMode::Kind::prism_y) return {0.0, at.squaredNorm()};
  return at * std::pow(at.norm(), power);
}

/// In coordinates about the board's centre, 1 at the ends of its longer side.
std::vector<ErrorMode> print_modes(std::span<const Eigen::Vector3d> points) {
  const auto num = static_cast<Index>(points.size());
  MatrixXd q(2, num);
  for (Index i = 0; i < num; ++i) q.col(i) = points[static_cast<std::size_t>(i)].head<2>();
  const Eigen::Vector2d low = q.rowwise().minCoeff(), high = q.rowwise().maxCoeff();
  const double half = 0.5 * (high - low).maxCoeff();
  q = (q.colwise() - 0.5 * (low + high)) / half;
  const auto x = q.row(0).array(), y = q.row(1).array();
  std::vector<ErrorMode> modes(8);
  for (ErrorMode& mode : modes) mode.displacement = MatrixXd::Zero(2, num);
  modes[0].kind = ErrorMode::Kind::lengths;
  modes[0].displacement << 0.5 * x.matrix(), -0.5 * y.matrix();
  modes[1].kind = ErrorMode::Kind::angle;
  modes[1].displacement << 0.5 * y.matrix(), 0.5 * x.matrix();
  for (Index row = 0; row < 2; ++row) {
    modes[static_cast<std::size_t>(2 + row)].displacement.row(row) = x.square();
    modes[static_cast<std::size_t>(4 + row)].displacement.row(row) = x * y;
    modes[static_cast<std::size_t>(6 + row)].displacement.row(row) = y.square();
  }
  for (ErrorMode& mode : modes) {
    mode.displacement *= half;
    mode.largest_m = mode.displacement.colwise().norm().maxCoeff();
  }
  return modes;
}

/// Information and gradient of free lens parameters and modes, pose eliminated.
struct ModeScore {
  MatrixXd information;
  VectorXd gradient;
};

/// One view's part in a score.
struct ModeView {
  const ViewArrays& corners;
  const Rigid3& cam_from_board;
  const std::vector<Eigen::Vector3d>& board_points;
  const Lens& lens;
};

/// Derivative of the view's pixels by the size of a mode, where that by a point of the board is the pose's translation.
VectorXd column_of(const ErrorMode& mode, const ModeView& view, const Eigen::Ref<const MatrixXd>& by_point) {
  const Index half = by_point.rows() / 2;
  const VectorXd focal = params(view.lens).head<2>();
  VectorXd column = VectorXd::Zero(by_point.rows());
  for (std::size_t i = 0; i < view.corners.size(); ++i) {
    const auto u = static_cast<Index>(i), v = half + u;
    const auto point = view.corners.index[i];
    if (mode.is_of_lens()) {
      const Eigen::Vector3d in_cam = view.cam_from_board * view.board_points[static_cast<std::size_t>(point)];
      const Eigen::Vector2d by = displacement_of(mode.kind, view.lens, in_cam);
      column[u] = focal[0] * by.x();
      column[v] = focal[1] * by.y();
    } else {
      const Eigen::Vector2d by = mode.displacement.col(point);
      column[u] = by_point.row(u).head<2>().dot(by);
      column[v] = by_point.row(v).head<2>().dot(by);
    }
  }
  return column;
}

std::optional<ModeScore> mode_score_of(const ModeView& view, const PreparedLens& lens, const PointArrays& points,
                                       const std::vector<Index>& free, const std::vector<ErrorMode>& modes) {
  Columns columns;
  if (!fill_columns(lens, view.cam_from_board, points, view.corners, columns)) return std::nullopt;
  const auto rows = static_cast<Index>(columns.num_rows());
  const auto column = [&](Index c) { return Eigen::Map<const VectorXd>(columns[static_cast<int>(c)], rows); };
  MatrixXd J(rows, std::ssize(free) + std::ssize(modes)), pose(rows, 6);
  for (Index c = 0; c < 6; ++c) pose.col(c) = column(Columns::pose + c);
  Index at = 0;
  for (const Index parameter : free) J.col(at++) = column(parameter);
  for (const ErrorMode& mode : modes) J.col(at++) = column_of(mode, view, pose);
  const Llt V(MatrixXd(pose.transpose() * pose));
  if (!V.is_positive()) return std::nullopt;
  J -= pose * V.solve_each(pose.transpose() * J);
  return ModeScore{J.transpose() * J, J.transpose() * column(Columns::residual)};
}

std::vector<ModeScore> mode_scores_of(std::span<const BoardView> used, const CalibrateReport& report,
                                      const std::vector<Index>& free, const std::vector<ErrorMode>& modes) {
  const PreparedLens lens = prepare(report.camera.lens);
  const PointArrays points = make_arrays(report.board_points);
  std::vector<ModeScore> scores;
  std::size_t k = 0;
  for (const ViewFit& fit : report.views) {
    if (!fit.used) continue;
    const ViewArrays corners = make_arrays(used[k++]);
    const ModeView view{corners, fit.cam_from_board, report.board_points, report.camera.lens};
    const auto score = mode_score_of(view, lens, points, free, modes);
    if (!score) return {};
    scores.push_back(*score);
  }
  return scores;
}

/// What the photos say of the modes together: information and score once the lens follows.
struct ReducedModes {
  Index num_free = 0;
  MatrixXd information;
  VectorXd alone;  ///< Information of each, were the lens fixed.
  VectorXd score;
  MatrixXd follows;                ///< Of the lens, by the modes: dθ/dmode.
  std::vector<ModeScore> of_view;  ///< At the lens' own optimum.
};

std::optional<ReducedModes> reduced_modes(std::vector<ModeScore> scores, Index num_free) {
  ModeScore sum = scores.front();
  for (std::size_t k = 1; k < scores.size(); ++k) {
    sum.information += scores[k].information;
    sum.gradient += scores[k].gradient;
  }
  const Index num_modes = sum.gradient.size() - num_free;
  const MatrixXd H = sum.information.topLeftCorner(num_free, num_free);
  const VectorXd scale = H.diagonal().cwiseSqrt().cwiseInverse();
  const Llt llt(scaled_by(scale, H));
  if (!llt.is_positive() || !scale.allFinite()) return std::nullopt;
  const auto solve = [&](const MatrixXd& right) -> MatrixXd {
    return scale.asDiagonal() * llt.solve_each(scale.asDiagonal() * right);
  };
  ReducedModes all{.num_free = num_free};
  const MatrixXd coupling = sum.information.topRightCorner(num_free, num_modes);
  all.follows = -solve(coupling);
  all.information = sum.information.bottomRightCorner(num_modes, num_modes);
  all.alone = all.information.diagonal();
  all.information += coupling.transpose() * all.follows;
  // Rejection and weights of the solve leave the lens a little beside the optimum of all corners alike.
  const VectorXd to_optimum = -solve(sum.gradient.head(num_free));
  for (ModeScore& score : scores) score.gradient += score.information.leftCols(num_free) * to_optimum;
  all.score = VectorXd::Zero(num_modes);
  for (const ModeScore& score : scores) all.score += score.gradient.tail(num_modes);
  all.of_view = std::move(scores);
  return all;
}

/// One mode estimated alone: its size, σ by the corners' noise and σ by the photos' scatter.
struct ModeEstimate {
  double size = 0.0, by_noise = 0.0, by_scatter = 0.0;

  [[nodiscard]] double sigma() const { return std::max(by_noise, by_scatter); }
};

ModeEstimate mode_estimate_of(const ReducedModes& all, Index mode, double noise_px) {
  const double information = all.information(mode, mode);
  ModeEstimate one{.size = -all.score[mode] / information, .by_noise = noise_px / std::sqrt(information)};
  VectorXd step = VectorXd::Zero(all.num_free + all.score.size());
  step.head(all.num_free) = one.size * all.follows.col(mode);
  step[all.num_free + mode] = one.size;
  double sum = 0.0;
  for (const ModeScore& view : all.of_view) {
    const VectorXd gradient = view.gradient + view.information * step;
    const double own = gradient[all.num_free + mode] + all.follows.col(mode).dot(gradient.head(all.num_free));
    sum += own * own;
  }
  const auto n = static_cast<double>(all.of_view.size());
  one.by_scatter = std::sqrt(sum * n / (n - 2.0)) / information;
  return one;
}

/// Of Student's distribution what `z` is of the normal one (Abramowitz & Stegun 26.7.5).
double student(double z, double dof) {
  return z + (std::pow(z, 3) + z) / (4.0 * dof) +
         (5.0 * std::pow(z, 5) + 16.0 * std::pow(z, 3) + 3.0 * z) / (96.0 * dof * dof);
}

bool is_beyond(const ModeEstimate& one, double sigmas, std::size_t num_views) {
  return std::abs(one.size) > sigmas * one.by_noise &&
         std::abs(one.size) > student(sigmas, static_cast<double>(num_views) - 2.0) * one.by_scatter;
}

std::string mode_sentence(const ErrorMode& mode, const ModeEstimate& one) {
  const auto sized = [](double unit, double value) { return text_of(unit * std::abs(value), 2); };
  const double error = 3.0 * one.sigma();
  const std::string sigmas = " (" + text_of(std::abs(one.size) / one.sigma(), 2) + "σ)";
  switch (mode.kind) {
    case ErrorMode::Kind::lengths:
      return std::string("the print is ") + sized(100.0, one.size) + " ± " + sized(100.0, error) + " % too long " +
             (one.size > 0.0 ? "along its rows" : "along its columns") + ", against its other side";
    case ErrorMode::Kind::angle:
      return "the print's rows and columns are " + sized(1e3, one.size) + " ± " + sized(1e3, error) +
             " mrad off a right angle";
    case ErrorMode::Kind::spacing:
      return "the print's spacing is uneven, by up to " + sized(1e3 * mode.largest_m, one.size) + " ± " +
             sized(1e3 * mode.largest_m, error) + " mm";
    case ErrorMode::Kind::radial:
      return "the lens has radial distortion of a higher order than its model" + sigmas;
    case ErrorMode::Kind::prism_x:
    case ErrorMode::Kind::prism_y:
      return "the lens has thin-prism distortion, which its model has not" + sigmas;
  }
  return "";
}

/// The ratio of the print's lengths is hardly ever known to better than this, and photos of an upright board hardly
/// separate it from fx / fy.
constexpr double ordinary_lengths = 2e-3;

/// |by| in σ along its direction.
double sigmas_of(const VectorXd& by, const MatrixXd& cov) {
  const VectorXd scale = cov.diagonal().cwiseSqrt().cwiseInverse();
  const VectorXd scaled = scale.asDiagonal() * by;
  return std::sqrt(squared_mahalanobis(scaled, scaled_by(scale, cov)));
}

/// What the modes `found`, estimated together, move the lens by, with what they themselves are uncertain by.
VectorXd count_modes(const ReducedModes& all, const std::vector<Index>& found, double variance, MatrixXd& cov) {
  const Ldlt information(MatrixXd(all.information(found, found)));
  const MatrixXd follows = all.follows(Eigen::all, found);
  const VectorXd moved = -follows * information.solve(VectorXd(all.score(found)));
  cov += moved * moved.transpose() + variance * follows * information.solve_each(follows.transpose());
  return moved;
}

}  // namespace

ModelErrors model_errors(std::span<const BoardView> views, const CalibrateReport& report) {
  const Index num_params = report.camera.cov.rows();
  ModelErrors errors{.cov = MatrixXd::Zero(num_params, num_params)};
  const std::vector<Index> free = split_of(report).free;
  const std::vector<BoardView> used = used_views(views, report, views.size());
  if (!is_central(report.camera.lens) || free.empty() || used.size() < least_views_of_modes) return errors;
  std::vector<ErrorMode> modes = print_modes(report.board_points);
  for (const auto kind : {ErrorMode::Kind::radial, ErrorMode::Kind::prism_x, ErrorMode::Kind::prism_y})
    modes.push_back({.kind = kind});
  std::vector<ModeScore> scores = mode_scores_of(used, report, free, modes);
  const std::optional<ReducedModes> all =
      scores.empty() ? std::nullopt : reduced_modes(std::move(scores), std::ssize(free));
  if (!all) return errors;

  const MatrixXd stated = report.camera.cov(free, free);
  MatrixXd cov = MatrixXd::Zero(std::ssize(free), std::ssize(free));
  std::vector<Index> found;
  double largest = 0.0, variance = 0.0;
  for (Index m = 0; m < std::ssize(modes); ++m) {
    constexpr double nothing_left = 1e-9;  // of it: the mode is what lens and poses do
    if (!(all->information(m, m) > nothing_left * all->alone[m])) continue;
    const ErrorMode& mode = modes[static_cast<std::size_t>(m)];
    const ModeEstimate one = mode_estimate_of(*all, m, report.noise_px);
    if (is_beyond(one, included_sigmas, used.size())) {
      found.push_back(m);
      variance = std::max(variance, one.sigma() * one.sigma() * all->information(m, m));
      const double sigmas = std::abs(one.size) / one.sigma();
      if (sigmas <= largest) continue;
      largest = sigmas;
      errors.text = mode_sentence(mode, one);
      errors.is_of_lens = mode.is_of_lens();
      errors.is_proved = is_beyond(one, proved_sigmas, used.size());
    } else if (mode.kind == ErrorMode::Kind::lengths) {
      const double sigma2 = 1.0 / (1.0 / (one.sigma() * one.sigma()) + 1.0 / (ordinary_lengths * ordinary_lengths));
      const VectorXd by = std::sqrt(sigma2) * all->follows.col(m);
      if (sigmas_of(by, stated) > 1.0) cov += by * by.transpose();
    }
  }
  if (!found.empty()) errors.moves = sigmas_of(count_modes(*all, found, variance, cov), stated);
  errors.cov(free, free) = cov;
  return errors;
}

}  // namespace alidade
