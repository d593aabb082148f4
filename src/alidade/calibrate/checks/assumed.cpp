#include "alidade/calibrate/checks/assumed.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "alidade/calibrate/study.h"
#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

using Eigen::Index;

/// Typical error of a value that a user wrote down.
double ordinary_error(const std::string& name, double value) {
  if (name == "fx" || name == "fy") return 0.003 * value;
  if (name == "cx" || name == "cy") return 2.0;  // px
  if (name == "gap_m") return 2e-3;              // by a ruler
  if (name == "glass_m") return 0.02 * value;    // a plate's tolerance
  if (name == "n_glass") return 0.01;            // one glass for another
  if (name == "n_water") return 0.003;           // 15 °C, or half the way from fresh to sea water
  return 0.0;                                    // a term that the model does not have
}

/// dθ/da of the free with respect to the fixed parameters; empty where the linearisation fails.
Eigen::MatrixXd sensitivity(std::span<const ViewScore> scores, const LensSplit& split) {
  if (scores.empty()) return {};
  Eigen::MatrixXd S = 0.0 * scores.front().information;
  for (const ViewScore& view : scores) S += view.information;
  const Eigen::MatrixXd of_free = S(split.free, split.free);
  const Eigen::VectorXd scale = of_free.diagonal().cwiseSqrt().cwiseInverse();
  const Llt llt(scaled_by(scale, of_free));
  if (!llt.is_positive()) return {};
  return -(scale.asDiagonal() * llt.solve_each(scale.asDiagonal() * S(split.free, split.fixed)));
}

/// The square of a board. The lens of a central camera is the same for all; the poses' distances follow it.
Assumption square_of(const Board& board, const CalibrateConfig& config, std::span<const BoardView> views,
                     const CalibrateReport& report, const LensSplit& split) {
  constexpr double ordinary = 2e-3;  // a printer's, of the length
  Assumption square{.name = "square_m", .value = board.square_m, .ordinary = ordinary * board.square_m};
  square.remedy = "measure the board: a port's gap follows the length of a square";
  if (is_central(report.camera.lens)) return square;
  CalibrateConfig scaled = config;
  scaled.board_shape = BoardShape::given;
  std::vector<Eigen::Vector3d> points = report.board_points;
  for (Eigen::Vector3d& point : points) point *= 1.0 + ordinary;
  const std::vector<BoardView> used = used_views(views, report, 40);
  const ImageSize size{report.camera.width_px, report.camera.height_px};
  const CalibrateReport before = calibrate(board, used, size, scaled, report.board_points);
  const CalibrateReport after = calibrate(board, used, size, scaled, points);
  if (after.status != CalibrateReport::Status::converged || before.status != after.status) return square;
  const Eigen::VectorXd moved = params(after.camera.lens) - params(before.camera.lens);
  const auto names = param_names(report.camera.lens);
  for (const Index i : split.free) {
    const double sigmas = std::abs(moved[i]) / std::sqrt(report.camera.cov(i, i));
    if (sigmas <= square.moves) continue;
    square.moves = sigmas;
    square.moved = names[static_cast<std::size_t>(i)];
    square.moved_by = moved[i];
  }
  return square;
}

/// The covariance of a lens that was given goes into what was estimated with it.
void count_air(const Camera& air, const Eigen::MatrixXd& K, const LensSplit& split, CalibrateReport& report) {
  const Index num = report.camera.cov.rows();
  Eigen::MatrixXd given = Eigen::MatrixXd::Zero(num, num);
  const Index of_air = std::min(air.cov.rows(), num);
  given.topLeftCorner(of_air, of_air) = air.cov.topLeftCorner(of_air, of_air);
  const Eigen::MatrixXd C = given(split.fixed, split.fixed), between = K * C;
  Eigen::MatrixXd& cov = report.camera.cov;
  cov(split.free, split.free) = (cov(split.free, split.free) + between * K.transpose()).eval();
  cov(split.free, split.fixed) = between;
  cov(split.fixed, split.free) = between.transpose();
  cov(split.fixed, split.fixed) = C;
}

double median_depth_m(const CalibrateReport& report) {
  std::vector<double> depths;
  for (const ViewFit& view : report.views)
    if (view.used) depths.push_back(view.cam_from_board.translation.z());
  return median_of(std::move(depths));
}

std::string words_of(const UnseenMode& unseen, const CalibrateReport& report) {
  constexpr double thin_rad = 0.1, n = 1.5;  // a window
  const auto sized = [&](double unit) { return text_of(unit * unseen.size, 2); };
  const double focal_px = params(report.camera.lens)[0];
  switch (unseen.kind) {
    case ErrorMode::Kind::focus:
      return "a focal length that follows the distance, by " + sized(100.0 / median_depth_m(report)) +
             " % from far away to these boards";
    case ErrorMode::Kind::pupil:
      return "an entrance pupil that moves by " + sized(1e3) + " mm · θ²";
    case ErrorMode::Kind::plate_x:
    case ErrorMode::Kind::plate_y:
      return "a window of " + sized(1e3 * n / (thin_rad * (1.0 - 1.0 / (n * n)))) + " mm, tilted by 0.1 rad about " +
             (unseen.kind == ErrorMode::Kind::plate_x ? "y" : "x");
    case ErrorMode::Kind::tilt:
      return "corners off along the tilt, by " + sized(0.1 * std::sqrt(0.5) * focal_px) +
             " px where a board tilted by 45° is 10 % nearer than at its middle";
    default:
      return "boards that all move by " + sized(1e3) + " mm along " +
             (unseen.kind == ErrorMode::Kind::motion_z   ? "the axis"
              : unseen.kind == ErrorMode::Kind::motion_x ? "the rows"
                                                         : "the columns") +
             " while rows are read";
  }
}

}  // namespace

std::optional<Assumption> not_tested(std::span<const UnseenMode> unseen, const CalibrateReport& report) {
  if (unseen.empty()) return std::nullopt;
  const auto names = param_names(report.camera.lens);
  Assumption row{.name = "lens.not_tested", .value = std::nan(""), .sigma = 0.0, .moves = std::nan("")};
  row.moved = "these photos would not show, though it moves the lens by 5σ: ";
  for (std::size_t i = 0; i < unseen.size(); ++i)
    row.moved += (i == 0 ? "" : "; ") + words_of(unseen[i], report) + " (" +
                 names[static_cast<std::size_t>(unseen[i].moved)] + ")";
  return row;
}

std::vector<Assumption> count_assumptions(const Board& board, const CalibrateConfig& config,
                                          std::span<const BoardView> views, std::span<const ViewScore> scores,
                                          const std::optional<Camera>& air, CalibrateReport& report) {
  const LensSplit split = split_of(report);
  const Eigen::MatrixXd K = split.fixed.empty() ? Eigen::MatrixXd() : sensitivity(scores, split);
  const bool air_has_cov = air && air->cov.size() > 0 && K.size() > 0;
  if (air_has_cov) count_air(*air, K, split, report);
  std::vector<Assumption> assumed = {square_of(board, config, views, report, split)};
  const auto names = param_names(report.camera.lens);
  const Eigen::VectorXd values = params(report.camera.lens);
  for (std::size_t h = 0; h < split.fixed.size(); ++h) {
    const Index at = split.fixed[h];
    const std::string& name = names[static_cast<std::size_t>(at)];
    Assumption row{.name = name, .value = values[at], .ordinary = ordinary_error(name, values[at])};
    const bool of_air = air && at < 10;
    if (of_air && air_has_cov) row.sigma = std::sqrt(std::max(0.0, report.camera.cov(at, at)));
    if (!row.sigma && row.ordinary == 0.0) row.sigma = 0.0;  // exact: the model is one without it
    row.remedy =
        of_air ? "give an --air camera with its covariance" : "estimate " + name + ", or give it with a --prior";
    const double error = row.sigma.value_or(row.ordinary);
    for (Index i = 0; i < K.rows() && error > 0.0; ++i) {
      const Index free = split.free[static_cast<std::size_t>(i)];
      const double by = K(i, static_cast<Index>(h)) * error,
                   sigmas = std::abs(by) / std::sqrt(report.camera.cov(free, free));
      if (sigmas <= row.moves) continue;
      row.moves = sigmas;
      row.moved = names[static_cast<std::size_t>(free)];
      row.moved_by = by;
    }
    assumed.push_back(std::move(row));
  }
  return assumed;
}

}  // namespace alidade
