#include "alidade/calibrate/checks/model_errors.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "alidade/calibrate/checks/error_modes.h"
#include "alidade/calibrate/checks/judge.h"
#include "alidade/calibrate/checks/view_scores.h"
#include "alidade/calibrate/solve/columns.h"
#include "alidade/calibrate/study.h"
#include "alidade/estimation/innovation.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t least_views_of_modes = 6;
constexpr double included_sigmas = 2.5, proved_sigmas = 4.0;

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
  const Camera& camera;
};

Eigen::Vector3d middle_of(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) sum += point;
  return sum / static_cast<double>(points.size());
}

/// Derivative of the view's pixels by the size of a mode, where that by a point of the board is the pose's translation.
VectorXd column_of(const ErrorMode& mode, const ModeView& view, const Eigen::Ref<const MatrixXd>& by_point) {
  const Index half = by_point.rows() / 2;
  const VectorXd focal = params(view.camera.lens).head<2>();
  VectorXd column = VectorXd::Zero(by_point.rows());
  SeenPoint seen{.normal = view.cam_from_board.rotation * Eigen::Vector3d::UnitZ(),
                 .middle_m = (view.cam_from_board * middle_of(view.board_points)).z()};
  for (std::size_t i = 0; i < view.corners.size(); ++i) {
    const auto u = static_cast<Index>(i), v = half + u;
    const auto point = view.corners.index[i];
    const Eigen::Vector3d in_cam = view.cam_from_board * view.board_points[static_cast<std::size_t>(point)];
    if (mode.is_of_rays()) {
      seen.in_cam = in_cam;
      seen.row = view.corners.v_px[i] / view.camera.height_px - 0.5;
      const Eigen::Vector3d by = view.cam_from_board.rotation.conjugate() * displacement_in_cam(mode.kind, seen);
      column[u] = by_point.row(u).head<3>().dot(by);
      column[v] = by_point.row(v).head<3>().dot(by);
    } else if (mode.is_of_lens()) {
      const Eigen::Vector2d by = displacement_of(mode.kind, view.camera.lens, in_cam);
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
    const ModeView view{corners, fit.cam_from_board, report.board_points, report.camera};
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

/// How much larger it is than what chance shows in `sigmas` σ.
double times_chance(const ModeEstimate& one, double sigmas, std::size_t num_views) {
  const double by_scatter = students(sigmas, static_cast<double>(num_views) - 2.0) * one.by_scatter;
  return std::abs(one.size) / std::max(sigmas * one.by_noise, by_scatter);
}

/// What is counted of a mode that is so much larger than chance: its square less that of chance. Terms of a lens do
/// nearly what its own parameters do: where boards are they hardly matter, and counting them costs most. Of those it is
/// the size less that of chance.
double share_beyond_chance(const ErrorMode& mode, double times) {
  if (times <= 1.0) return 0.0;
  return mode.is_of_lens() && !mode.is_of_rays() ? 1.0 - 1.0 / times : std::sqrt(1.0 - 1.0 / (times * times));
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

/// A mode that the photos show.
struct FoundMode {
  Index mode = 0;
  double prior = 0.0;  ///< Precision of it about 0: an ordinary size, where it is not proved.
  double share = 1.0;  ///< That is counted.
};

/// What the modes `found`, estimated together, move the lens by, with what they themselves are uncertain by.
VectorXd count_modes(const ReducedModes& all, const std::vector<FoundMode>& found, double variance, MatrixXd& cov) {
  std::vector<Index> modes;
  for (const FoundMode& each : found) modes.push_back(each.mode);
  MatrixXd H = all.information(modes, modes), follows = all.follows(Eigen::all, modes);
  for (Index i = 0; i < std::ssize(found); ++i) {
    H(i, i) += variance * found[static_cast<std::size_t>(i)].prior;
    follows.col(i) *= found[static_cast<std::size_t>(i)].share;
  }
  const Ldlt information(H);
  const VectorXd moved = -follows * information.solve(VectorXd(all.score(modes)));
  cov += moved * moved.transpose() + variance * follows * information.solve_each(follows.transpose());
  return moved;
}

/// Which modes the photos show, and the one to name.
class ModeFindings {
 public:
  ModeFindings(const ReducedModes& all, const std::vector<ErrorMode>& modes, const CalibrateReport& report,
               std::size_t num_views, ModelErrors& errors)
      : all_(all),
        modes_(modes),
        camera_(report.camera),
        noise_px_(report.noise_px),
        num_views_(num_views),
        errors_(errors) {
    for (Index m = 0; m < std::ssize(modes); ++m) estimates_.push_back(mode_estimate_of(all, m, noise_px_));
  }

  /// A mode by itself; whether it is included.
  bool take(Index m) {
    if (modes_[static_cast<std::size_t>(m)].is_untested()) return false;
    const ModeEstimate& one = estimates_[static_cast<std::size_t>(m)];
    const double times = times_chance(one, included_sigmas, num_views_);
    if (!is_determined(m) || times <= 1.0) return false;
    include(m, std::abs(one.size) / one.sigma(), times, times_chance(one, proved_sigmas, num_views_) > 1.0);
    return true;
  }

  /// Modes of one cause, each of which the others hide: by their χ² and by Hotelling's T² of the photos.
  void take_together(ErrorMode::Kind first, ErrorMode::Kind last) {
    std::vector<Index> group;
    for (Index m = 0; m < std::ssize(modes_); ++m) {
      const ErrorMode::Kind kind = modes_[static_cast<std::size_t>(m)].kind;
      if (kind >= first && kind <= last && is_determined(m)) group.push_back(m);
    }
    const double sigmas = group.empty() ? 0.0 : sigmas_together(group);
    if (sigmas < included_sigmas) return;
    std::ranges::sort(group, std::ranges::greater{}, [&](Index m) { return sigmas_alone(m); });
    for (const Index m : group)
      include(m, m == group.front() ? sigmas : 0.0, sigmas / included_sigmas, sigmas > proved_sigmas);
  }

  /// Those of ordinary sizes that are not proved where they move a parameter by 5 of `sigmas`. Of `free`.
  [[nodiscard]] std::vector<UnseenMode> unseen(const VectorXd& sigmas, const std::vector<Index>& free) const {
    constexpr double too_far = 5.0, usual = 2.0;
    std::vector<UnseenMode> unseen;
    for (Index m = 0; m < std::ssize(modes_); ++m) {
      const ErrorMode& mode = modes_[static_cast<std::size_t>(m)];
      if (!mode.is_of_rays() || std::ranges::find(found_, m, &FoundMode::mode) != found_.end()) continue;
      Index moved = 0;
      const double size = too_far / all_.follows.col(m).cwiseAbs().cwiseQuotient(sigmas).maxCoeff(&moved);
      const bool would_show = mode.kind != ErrorMode::Kind::tilt && size > proved_sigmas * sigma(m);
      if (would_show || !(size < usual * ordinary_size(mode, camera_))) continue;
      unseen.push_back({mode.kind, size, free[static_cast<std::size_t>(moved)]});
    }
    return unseen;
  }

  [[nodiscard]] double sigma(Index m) const { return estimates_[static_cast<std::size_t>(m)].sigma(); }
  [[nodiscard]] const std::vector<FoundMode>& found() const { return found_; }
  [[nodiscard]] double variance() const { return variance_; }

 private:
  /// Not what lens and poses do.
  [[nodiscard]] bool is_determined(Index m) const {
    constexpr double nothing_left = 1e-9;  // of it
    return all_.information(m, m) > nothing_left * all_.alone[m];
  }
  [[nodiscard]] double sigmas_alone(Index m) const {
    return std::abs(estimates_[static_cast<std::size_t>(m)].size) / sigma(m);
  }

  [[nodiscard]] double sigmas_together(const std::vector<Index>& group) const {
    const MatrixXd information = all_.information(group, group), follows = all_.follows(Eigen::all, group);
    const VectorXd score = all_.score(group), size = -Ldlt(information).solve(score);
    VectorXd step = VectorXd::Zero(all_.num_free + all_.score.size());
    step.head(all_.num_free) = follows * size;
    for (std::size_t i = 0; i < group.size(); ++i) step[all_.num_free + group[i]] = size[static_cast<Index>(i)];
    MatrixXd scatter = 0.0 * information;
    for (const ModeScore& view : all_.of_view) {
      const VectorXd gradient = view.gradient + view.information * step;
      const VectorXd own =
          VectorXd(gradient.tail(all_.score.size()))(group) + follows.transpose() * gradient.head(all_.num_free);
      scatter += own * own.transpose();
    }
    const auto num = static_cast<double>(group.size()), n = static_cast<double>(num_views_);
    const double by_noise = -score.dot(size) / (noise_px_ * noise_px_);
    const double T2 = score.dot(Ldlt(scatter * n / (n - 1.0)).solve(score));
    return std::min(score_sigmas(by_noise, num, 0.0), score_sigmas(n * T2 / (n - 1.0 + T2), num, n));
  }

  /// Of few photos chance shows sizes that no lens has, and of many modes one: what is not proved counts by its share
  /// beyond chance, and as far as it is ordinary.
  void include(Index m, double sigmas, double times_of_chance, bool is_proved) {
    const double share = share_beyond_chance(modes_[static_cast<std::size_t>(m)], times_of_chance);
    auto at = std::ranges::find(found_, m, &FoundMode::mode);
    if (at == found_.end())
      at = found_.insert(at, {m, std::pow(ordinary_size(modes_[static_cast<std::size_t>(m)], camera_), -2), share});
    at->share = std::max(at->share, share);
    if (is_proved) *at = {.mode = m};
    variance_ = std::max(variance_, sigma(m) * sigma(m) * all_.information(m, m));
    if (sigmas <= largest_) return;
    const ErrorMode& mode = modes_[static_cast<std::size_t>(m)];
    const ModeEstimate& one = estimates_[static_cast<std::size_t>(m)];
    largest_ = sigmas;
    errors_.text = sentence_of(mode, one.size, one.sigma());
    errors_.is_of_lens = mode.is_of_lens();
    errors_.remedy = remedy_of(mode);
    errors_.is_proved = is_proved;
  }

  const ReducedModes& all_;
  const std::vector<ErrorMode>& modes_;
  const Camera& camera_;
  double noise_px_;
  std::size_t num_views_;
  ModelErrors& errors_;
  std::vector<ModeEstimate> estimates_;
  std::vector<FoundMode> found_;
  double variance_ = 0.0, largest_ = 0.0;
};

}  // namespace

ModelErrors model_errors(std::span<const BoardView> views, const CalibrateReport& report) {
  const Index num_params = report.camera.cov.rows();
  ModelErrors errors{.cov = MatrixXd::Zero(num_params, num_params)};
  const std::vector<Index> free = split_of(report).free;
  const std::vector<BoardView> used = used_views(views, report, views.size());
  if (!is_central(report.camera.lens) || free.empty() || used.size() < least_views_of_modes) return errors;
  const std::vector<ErrorMode> modes = error_modes(report.board_points);
  std::vector<ModeScore> scores = mode_scores_of(used, report, free, modes);
  const std::optional<ReducedModes> all =
      scores.empty() ? std::nullopt : reduced_modes(std::move(scores), std::ssize(free));
  if (!all) return errors;

  const MatrixXd stated = report.camera.cov(free, free);
  ModeFindings findings(*all, modes, report, used.size(), errors);
  MatrixXd cov = MatrixXd::Zero(std::ssize(free), std::ssize(free));
  for (Index m = 0; m < std::ssize(modes); ++m) {
    if (findings.take(m) || modes[static_cast<std::size_t>(m)].kind != ErrorMode::Kind::lengths) continue;
    const double sigma = findings.sigma(m);
    const double sigma2 = 1.0 / (1.0 / (sigma * sigma) + 1.0 / (ordinary_lengths * ordinary_lengths));
    const VectorXd by = std::sqrt(sigma2) * all->follows.col(m);
    if (sigmas_of(by, stated) > 1.0) cov += by * by.transpose();
  }
  findings.take_together(ErrorMode::Kind::pupil, ErrorMode::Kind::plate_y);
  findings.take_together(ErrorMode::Kind::motion_x, ErrorMode::Kind::motion_z);
  if (!findings.found().empty())
    errors.moves = sigmas_of(count_modes(*all, findings.found(), findings.variance(), cov), stated);
  errors.cov(free, free) = cov;
  errors.unseen = findings.unseen((stated + cov).diagonal().cwiseSqrt(), free);
  return errors;
}

}  // namespace alidade
