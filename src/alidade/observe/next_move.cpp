#include "alidade/observe/next_move.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "alidade/geometry/decompositions.h"
#include "alidade/observe/solve/rotation_bundle.h"
#include "alidade/pantilt/head_rotation.h"

namespace alidade {
namespace {

constexpr std::size_t max_points = 50;

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
    const Eigen::Matrix4d cov = now.cov_px2 / (scale_.scale * scale_.scale);
    before_ = inverse_symmetric(cov);
  }

  std::optional<NextMove> best_move() {
    std::optional<NextMove> best;
    double least = std::numeric_limits<double>::infinity();
    const RotationBundle so_far = bundle_;
    for (const Eigen::Vector3d& target : candidates()) {
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
    return best;
  }

 private:
  [[nodiscard]] std::vector<Eigen::Vector3d> candidates() const {
    std::vector<Eigen::Vector3d> targets;
    for (const double length : {0.33, 0.66, 1.0}) {
      for (int i = 0; i < 8; ++i) {
        const double angle = i * std::numbers::pi / 4.0;
        targets.emplace_back(limits_.max_turn_rad * length * std::cos(angle),
                             limits_.max_turn_rad * length * std::sin(angle), 0.0);
      }
      if (limits_.can_roll) {
        for (const double side : {-1.0, 1.0}) targets.emplace_back(0.0, 0.0, side * limits_.max_turn_rad * length);
      }
    }
    targets.emplace_back(0.0, 0.0, 0.0);  // back to where it looks now
    return targets;
  }

  /// Frames on the way from where the head stands to `target`; how long it takes.
  double travel(const Eigen::Vector3d& target) {
    const Eigen::Vector3d way = target - at_;
    const double duration_s = way.cwiseAbs().maxCoeff() / limits_.rate_rad_per_s;
    const int steps = static_cast<int>(std::ceil(duration_s * limits_.frames_per_s));
    for (int i = 1; i <= steps; ++i) look_from(at_ + way * (static_cast<double>(i) / steps));
    return duration_s;
  }

  void look_from(const Eigen::Vector3d& pan_tilt_roll_rad) {
    RotationFrame frame;
    frame.cam_from_start = base_from_cam_rotation(pan_tilt_roll_rad).conjugate();
    const RotationView view(bundle_.camera, frame);
    const auto index = static_cast<int>(bundle_.frames.size());
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

  [[nodiscard]] Eigen::Vector4d variance_px2() const {
    RotationBundleConfig config;
    config.sigma_px = now_.sigma_px / scale_.scale;
    config.huber = 0.0;
    config.max_iterations = 0;
    const BundleSolution solution = solve_rotation_bundle(bundle_, CommonPrior(bundle_.camera), config);
    const Eigen::Matrix4d all = solution.information + before_;
    return inverse_symmetric(all).diagonal() * (scale_.scale * scale_.scale);
  }

  const ObservedNow& now_;
  const MoveLimits& limits_;
  PixelScale scale_;
  RotationBundle bundle_;
  Eigen::Matrix4d before_;
  Eigen::Vector3d at_ = Eigen::Vector3d::Zero();
};

}  // namespace

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
