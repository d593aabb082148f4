#include "alidade/rig/ray_start.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

/// Where the points are best put for a rotation: least squared distances from their lines.
Eigen::Vector3d best_translation(std::span<const ObservationLine> lines, const Eigen::Matrix3d& R) {
  Eigen::Matrix3d A = 1e-12 * Eigen::Matrix3d::Identity();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const ObservationLine& line : lines) {
    const Eigen::Matrix3d across =
        Eigen::Matrix3d::Identity() - line.direction_in_base * line.direction_in_base.transpose();
    A += across;
    b -= across * (R * line.point_in_board);
  }
  return solve_symmetric(A, b);
}

/// The rotation that best takes the points to where their lines pass nearest to them.
Eigen::Matrix3d best_rotation(std::span<const ObservationLine> lines, const Eigen::Matrix3d& R,
                              const Eigen::Vector3d& t) {
  const auto num = static_cast<double>(lines.size());
  Eigen::Vector3d from_mean = Eigen::Vector3d::Zero(), to_mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
  for (const ObservationLine& line : lines) {
    const double along = std::max(0.0, line.direction_in_base.dot(R * line.point_in_board + t));
    const Eigen::Vector3d to = along * line.direction_in_base;
    from_mean += line.point_in_board / num;
    to_mean += to / num;
    products += to * line.point_in_board.transpose();
  }
  products -= num * to_mean * from_mean.transpose();
  return nearest_rotation(products);
}

double misfit(std::span<const ObservationLine> lines, const Eigen::Matrix3d& R, const Eigen::Vector3d& t) {
  constexpr double cap_rad = 0.5;
  double sum = 0.0;
  for (const ObservationLine& line : lines) {
    const Eigen::Vector3d point = R * line.point_in_board + t;
    const double angle = std::atan2(point.cross(line.direction_in_base).norm(), point.dot(line.direction_in_base));
    sum += std::min(cap_rad, angle);
  }
  return sum / static_cast<double>(lines.size());
}

}  // namespace

std::vector<Eigen::Quaterniond> turns_of_a_cube() {
  constexpr double quarter = std::numbers::pi / 2.0;
  std::vector<Eigen::Quaterniond> turns;
  for (int x = 0; x < 4; ++x) {
    for (int y = 0; y < 4; ++y) {
      for (int z = 0; z < 4; ++z) {
        const Eigen::Quaterniond turn =
            exp_so3({x * quarter, 0.0, 0.0}) * exp_so3({0.0, y * quarter, 0.0}) * exp_so3({0.0, 0.0, z * quarter});
        const auto is_same = [&](const Eigen::Quaterniond& other) { return std::abs(turn.dot(other)) > 0.999; };
        if (std::ranges::none_of(turns, is_same)) turns.push_back(turn);
      }
    }
  }
  return turns;
}

std::optional<ObservationPose> pose_of_observation_lines(std::span<const ObservationLine> lines) {
  constexpr std::size_t least = 6;
  constexpr int iterations = 100;  // linear convergence, of which a start needs little
  if (lines.size() < least) return std::nullopt;
  std::optional<ObservationPose> best;
  for (const Eigen::Quaterniond& turn : turns_of_a_cube()) {
    Eigen::Matrix3d R = turn.toRotationMatrix();
    Eigen::Vector3d t = best_translation(lines, R);
    for (int i = 0; i < iterations; ++i) {
      R = best_rotation(lines, R, t);
      t = best_translation(lines, R);
    }
    const double left = misfit(lines, R, t);
    if (std::isfinite(left) && (!best || left < best->misfit_rad))
      best = ObservationPose{{Eigen::Quaterniond(R).normalized(), t}, left};
  }
  return best;
}

std::optional<ObservationPose> observation_pose(const RigProblem& problem, const std::vector<bool>& usable,
                                                const RigHead& rig_head, std::size_t head, std::size_t board) {
  RigHead in_own_base = rig_head;
  in_own_base.head.world_from_base = {};
  std::vector<ObservationLine> lines;
  for (std::size_t v = 0; v < problem.views.size(); ++v) {
    const RigView& view = problem.views[v];
    if (!usable[v] || view.head != head || view.board != board) continue;
    for (const Corner& corner : view.view->seen.corners) {
      const auto ray = ray_in_world(in_own_base, view.view->pan_tilt_rad, corner.px);
      if (ray)
        lines.push_back({ray->direction_in_world, problem.points_in_board[static_cast<std::size_t>(corner.index)]});
    }
  }
  return pose_of_observation_lines(lines);
}

}  // namespace alidade
