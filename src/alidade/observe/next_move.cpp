#include "alidade/observe/next_move.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/so3.h"
#include "alidade/observe/solve/solve.h"
#include "alidade/pantilt/head_rotation.h"

namespace alidade {
namespace {

constexpr std::size_t max_points = 50;
constexpr double shortest_length = 0.33;  // share of the allowed range

/// The covariance (normalised) for independent pixel errors: with the model's σ, and the correlations as stated.
Eigen::Matrix4d model_covariance(const ObservedNow& now, const Eigen::Matrix4d& cov) {
  if (!(now.sigma_model_px.minCoeff() > 0.0)) return cov;
  const Eigen::Vector4d sigma = now.cov_px2.diagonal().cwiseSqrt();
  const Eigen::Vector4d share = now.sigma_model_px.cwiseMin(sigma).cwiseQuotient(sigma);
  return share.asDiagonal() * cov * share.asDiagonal();
}

Eigen::Matrix4d without_negative(const Eigen::Matrix4d& symmetric) {
  const SymmetricEigen eigen = symmetric_eigen(symmetric);
  return eigen.vectors * eigen.values.cwiseMax(0.0).asDiagonal() * eigen.vectors.transpose();
}

class Planner {
 public:
  Planner(const ObservedNow& now, const MoveLimits& limits) : now_(now), limits_(limits) {
    scale_ = {0.5 * Eigen::Vector2d(now.width_px - 1.0, now.height_px - 1.0), 0.5 * now.width_px};
    bundle_.camera.k = scale_.normalised_intrinsics(now.k_px);
    const RotationView view(bundle_.camera, RotationFrame{});
    const std::size_t stride = std::max<std::size_t>(1, now.points_px.size() / max_points);
    for (std::size_t i = 0; i < now.points_px.size(); i += stride) {
      const auto ray = view.ray_in_start(scale_.normalised(now.points_px[i]));
      if (ray) bundle_.points.push_back({rotation_to(*ray), Eigen::Vector2d::Zero(), 0.0});
    }
    look_from({0.0, 0.0, 0.0});
    const Eigen::Matrix4d cov = now.cov_px2 / (scale_.scale * scale_.scale), model = model_covariance(now, cov);
    before_ = inverse_symmetric(model);
    given_before_ = without_negative(cov - model);
  }

  std::optional<NextMove> best_move() {
    std::optional<NextMove> best;
    double least = std::numeric_limits<double>::infinity();
    const RotationBundle so_far = bundle_;
    for (const Eigen::Vector3d& target : candidates()) {
      if (!is_short_enough((target - at_).cwiseAbs().maxCoeff(), limits_)) continue;
      bundle_ = so_far;
      NextMove move{target, travel(target)};
      if (!(move.duration_s > 0.0)) continue;
      const Eigen::Vector4d variance = variance_px2();
      const double f = now_.k_px[0], g = now_.k_px[1];
      const double score = variance[0] / (f * f) + variance[1] / (g * g) + (variance[2] + variance[3]) / (f * g);
      if (!(score < least)) continue;
      least = score;
      move.sigma_px = variance.cwiseSqrt();
      best = move;
    }
    bundle_ = so_far;
    if (!best) return best;
    (void)travel(best->pan_tilt_roll_rad);
    at_ = best->pan_tilt_roll_rad;
    best->sigma_px = stated_sigma_px();
    return best->sigma_px.allFinite() ? best : std::nullopt;
  }

 private:
  [[nodiscard]] std::vector<Eigen::Vector3d> candidates() const {
    std::vector<Eigen::Vector3d> targets;
    for (const double length : {shortest_length, 0.66, 1.0}) {
      for (int i = 0; i < 8; ++i) {
        const double angle = i * std::numbers::pi / 4.0;
        targets.emplace_back(limits_.max_turn_rad * length * std::cos(angle),
                             limits_.max_turn_rad * length * std::sin(angle), 0.0);
      }
      if (limits_.can_roll) {
        for (const double side : {-1.0, 1.0}) targets.emplace_back(0.0, 0.0, side * limits_.max_turn_rad * length);
      }
    }
    targets.emplace_back(0.0, 0.0, 0.0);  // back to the current direction
    return targets;
  }

  /// Adds the frames on the way from the current position to `target`; returns the duration [s].
  double travel(const Eigen::Vector3d& target) {
    const Eigen::Vector3d way = target - at_;
    const double duration_s = way.cwiseAbs().maxCoeff() / limits_.rate_rad_per_s;
    const int steps = static_cast<int>(std::ceil(duration_s * limits_.frames_per_s));
    for (int i = 1; i <= steps; ++i) look_from(at_ + way * (static_cast<double>(i) / steps));
    return duration_s;
  }

  void look_from(const Eigen::Vector3d& pan_tilt_roll_rad) {
    const auto index = static_cast<int>(bundle_.frames.size());
    RotationFrame frame;
    frame.cam_from_start = base_from_cam_rotation(pan_tilt_roll_rad).conjugate();
    frame.t_s = index / limits_.frames_per_s;
    if (index > 0) {
      const Eigen::Quaterniond before = bundle_.frames.back().cam_from_start;
      frame.dt_s = 1.0 / limits_.frames_per_s;
      frame.rate_rad_per_s = -log_so3(frame.cam_from_start * before.conjugate()) / frame.dt_s;
    }
    angles_rad_.resize(bundle_.frames.size());  // drops those of a rejected candidate
    angles_rad_.push_back(pan_tilt_roll_rad);
    const RotationView view(bundle_.camera, frame);
    for (std::size_t i = 0; i < bundle_.points.size(); ++i) {
      const auto q = view.project(bundle_.points[i]);
      if (!q) continue;
      const Eigen::Vector2d px = *q * scale_.scale + scale_.centre;
      const bool is_inside =
          px.x() > 5.0 && px.y() > 5.0 && px.x() < now_.width_px - 6.0 && px.y() < now_.height_px - 6.0;
      if (is_inside) bundle_.observations.push_back({index, static_cast<int>(i), *q});
    }
    bundle_.frames.push_back(frame);
  }

  [[nodiscard]] BundleSolution solution() const {
    RotationBundleConfig config;
    config.nuisances.rotation = now_.sigma_angle_rad > 0.0 || now_.sigma_rate_rad_per_s > 0.0;
    config.sigma_rotation_rad = now_.sigma_angle_rad;
    config.sigma_rate_rad_per_s = now_.sigma_rate_rad_per_s;
    config.sigma_px = sigma_px();
    config.huber = 0.0;
    config.max_iterations = 0;
    BundleSolution solution = solve_rotation_bundle(bundle_, CommonPrior(bundle_.camera), config);
    solution.prior_information = before_;
    solution.prior_gradient = Eigen::Vector4d::Zero();
    return solution;
  }

  /// σ of a pixel with the design effect, normalised.
  [[nodiscard]] double sigma_px() const {
    return now_.sigma_px * std::sqrt(std::max(1.0, now_.design_effect)) / scale_.scale;
  }

  /// Variance of fx, fy, cx, cy for independent pixel errors and exact given values.
  [[nodiscard]] Eigen::Vector4d variance_px2() const {
    const Eigen::Matrix4d all = solution().information + before_;
    return inverse_symmetric(all).diagonal() * (scale_.scale * scale_.scale);
  }

  /// σ including the errors of given values: their effect on the estimate during the moves, and the effect they had in
  /// the log before, weighted by its remaining share. Both come from the same errors, so in the worst case they add up.
  [[nodiscard]] Eigen::Vector4d stated_sigma_px() const {
    Adjustment moves{.has_value = true, .solution = solution(), .bundle = bundle_, .sigma_px = sigma_px()};
    const Eigen::Matrix4d model = inverse_symmetric(Eigen::Matrix4d(moves.solution.information + before_));
    CommonMatrix given = Eigen::Matrix4d::Zero();
    add_assumed(now_.assumed, cause_scores(log(), moves, {.height = now_.height_px / scale_.scale}), given);
    const Eigen::Matrix4d share = model * before_, earlier = share * given_before_ * share.transpose();
    const Eigen::Vector4d moved = earlier.diagonal().cwiseSqrt() + given.diagonal().head<4>().cwiseSqrt();
    const Eigen::Vector4d sigma = (model.diagonal() + moved.cwiseAbs2()).cwiseSqrt() * scale_.scale;
    return sigma.cwiseMin(now_.cov_px2.diagonal().cwiseSqrt());
  }

  /// The rotations of the frames as they would be measured.
  [[nodiscard]] RotationLog log() const {
    RotationLog log{.source = now_.source, .has_roll_rate = true};
    for (std::size_t k = 0; k < bundle_.frames.size(); ++k) {
      const RotationFrame& frame = bundle_.frames[k];
      log.rows.push_back({.t_s = frame.t_s,
                          .rate_rad_per_s = frame.rate_rad_per_s,
                          .pan_tilt_roll_rad = angles_rad_[k],
                          .base_from_cam = frame.cam_from_start.conjugate()});
    }
    return log;
  }

  const ObservedNow& now_;
  const MoveLimits& limits_;
  PixelScale scale_;
  RotationBundle bundle_;
  std::vector<Eigen::Vector3d> angles_rad_;                 ///< Pan, tilt, roll of each frame.
  Eigen::Matrix4d before_ = Eigen::Matrix4d::Zero();        ///< Information of the log, for independent errors.
  Eigen::Matrix4d given_before_ = Eigen::Matrix4d::Zero();  ///< Additional covariance of the log.
  Eigen::Vector3d at_ = Eigen::Vector3d::Zero();
};

}  // namespace

std::vector<Eigen::Vector2d> points_at_end(std::span<const ObserveResidual> seen, double frames_per_s) {
  constexpr double now_s = 0.25;
  constexpr std::size_t enough = 4;
  int end = 0;
  for (const ObserveResidual& each : seen) end = std::max(end, each.row);
  std::map<int, ObserveResidual> last;
  for (const ObserveResidual& each : seen) {
    const auto at = last.find(each.point);
    if (at == last.end() || at->second.row <= each.row) last[each.point] = each;
  }
  std::vector<Eigen::Vector2d> all, now;
  for (const auto& [point, each] : last) {
    all.push_back(each.px);
    if (end - each.row <= now_s * frames_per_s) now.push_back(each.px);
  }
  return now.size() < enough ? all : now;
}

void assume_estimated(const std::string& quantity, double sigma, std::vector<Assumption>& assumed) {
  static const std::map<std::string, std::string> names{{"k1", "k1"},
                                                        {"delay_s", "delay"},
                                                        {"mount_x_rad", "mount about x"},
                                                        {"mount_y_rad", "mount about y"},
                                                        {"mount_z_rad", "mount about z"}};
  const auto name = names.find(quantity);
  if (name != names.end()) assumed.push_back({.name = name->second, .sigma = sigma});
}

double shortest_way_rad(const MoveLimits& limits) {
  return shortest_length * std::numbers::sqrt2 / 2.0 * limits.max_turn_rad;  // along the longer axis
}

bool is_short_enough(double way_rad, const MoveLimits& limits) {
  constexpr double max_frames = 1e5;
  return way_rad / limits.rate_rad_per_s * limits.frames_per_s <= max_frames;
}

std::vector<NextMove> plan_next_moves(const ObservedNow& now, const MoveLimits& limits, int num_moves,
                                      const Progress& progress) {
  std::vector<NextMove> moves;
  if (now.points_px.empty()) return moves;
  Planner planner(now, limits);
  for (int i = 0; i < num_moves; ++i) {
    report_progress(progress, "moves", static_cast<std::size_t>(i), static_cast<std::size_t>(num_moves));
    const auto move = planner.best_move();
    if (!move) break;
    moves.push_back(*move);
  }
  return moves;
}

}  // namespace alidade
