#include "alidade/rig/rig_frame.h"

#include <cmath>
#include <tuple>
#include <utility>
#include <vector>

namespace alidade {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;

Vector6 difference(const Rigid3& to, const Rigid3& from) {
  Vector6 xi;
  xi << from.rotation.conjugate() * (to.translation - from.translation),
      log_so3(from.rotation.conjugate() * to.rotation);
  return xi;
}

/// The step that retract() takes from one head to the other.
HeadVector difference(const Head& to, const Head& from) {
  HeadVector step;
  step << difference(to.world_from_base, from.world_from_base), to.pan_to_tilt_m - from.pan_to_tilt_m,
      to.tilt_to_cam_m - from.tilt_to_cam_m, log_so3(from.cam_from_tilt.conjugate() * to.cam_from_tilt),
      to.encoder.pan_zero_rad - from.encoder.pan_zero_rad, to.encoder.tilt_zero_rad - from.encoder.tilt_zero_rad,
      to.encoder.pan_scale - from.encoder.pan_scale, to.encoder.tilt_scale - from.encoder.tilt_scale,
      to.axes_skew_rad - from.axes_skew_rad, to.encoder.pan_cos_rad - from.encoder.pan_cos_rad,
      to.encoder.pan_sin_rad - from.encoder.pan_sin_rad, to.encoder.tilt_cos_rad - from.encoder.tilt_cos_rad,
      to.encoder.tilt_sin_rad - from.encoder.tilt_sin_rad;
  return step;
}

/// The tilt angle at which the camera looks square to the pan axis; 0 where it looks along the tilt axis.
double level_tilt_rad(const Head& head) {
  const Eigen::Vector3d axis_in_tilt = head.cam_from_tilt.conjugate() * Eigen::Vector3d::UnitZ();
  if (std::hypot(axis_in_tilt.y(), axis_in_tilt.z()) < 0.1) return 0.0;
  return std::atan2(axis_in_tilt.y(), axis_in_tilt.z());
}

/// The same head with its tilt counted from another angle: what the tilt loses, the mounting gains.
Head with_level(Head head, double level_rad) {
  const Eigen::Quaterniond tilt_from_level = exp_so3({-level_rad, 0.0, 0.0});
  head.encoder.tilt_zero_rad += level_rad / head.encoder.tilt_scale;
  head.tilt_to_cam_m = tilt_from_level.conjugate() * head.tilt_to_cam_m;
  head.cam_from_tilt = (head.cam_from_tilt * tilt_from_level).normalized();
  return head;
}

/// Heads in the world of the first head's camera at zero readings.
std::vector<Head> reframed(const std::vector<Head>& heads, const std::vector<double>& levels_rad) {
  const Rigid3 world_from_old = cam_from_world(heads[0], Eigen::Vector2d::Zero());
  std::vector<Head> out;
  for (std::size_t h = 0; h < heads.size(); ++h) {
    out.push_back(with_level(heads[h], levels_rad[h]));
    const Rigid3& old_from_base = heads[h].world_from_base;
    out.back().world_from_base = world_from_old * old_from_base;
  }
  return out;
}

Eigen::MatrixXd jacobian(const RigProblem& problem, const std::vector<Head>& heads,
                         const std::vector<double>& levels_rad) {
  constexpr double step = 1e-6;
  Eigen::MatrixXd J(num_head_params * static_cast<Eigen::Index>(heads.size()), problem.num_free());
  Eigen::Index col = 0;
  for (std::size_t h = 0; h < heads.size(); ++h) {
    for (const int param : problem.free[h]) {
      std::vector<Head> plus = heads, minus = heads;
      plus[h] = retract(heads[h], step * HeadVector::Unit(param));
      minus[h] = retract(heads[h], -step * HeadVector::Unit(param));
      const std::vector<Head> to = reframed(plus, levels_rad), from = reframed(minus, levels_rad);
      for (std::size_t k = 0; k < heads.size(); ++k)
        J.block<num_head_params, 1>(num_head_params * static_cast<Eigen::Index>(k), col) =
            difference(to[k], from[k]) / (2.0 * step);
      ++col;
    }
  }
  return J;
}

Rigid3 cam_from_cam(const Head& first, const Eigen::Vector2d& first_rad, const Head& second,
                    const Eigen::Vector2d& second_rad) {
  return cam_from_world(first, first_rad) * world_from_cam(second, second_rad);
}

/// The centre and the four corners of the range of a head's views, or of `min_rad` about its centre if that is more.
std::vector<Eigen::Vector2d> angles_of(const HeadCover& cover, double min_rad) {
  const Eigen::Vector2d centre = 0.5 * (cover.lowest_rad + cover.highest_rad);
  const Eigen::Vector2d half = (0.5 * (cover.highest_rad - cover.lowest_rad)).cwiseMax(0.5 * min_rad);
  const Eigen::Vector2d low = centre - half, high = centre + half;
  return {0.5 * (low + high), low, {low.x(), high.y()}, high, {high.x(), low.y()}};
}

}  // namespace

WorldAtCamera world_at_camera(const RigProblem& problem, const RigState& state, const Eigen::MatrixXd& cov) {
  std::vector<Head> heads;
  std::vector<double> levels_rad;
  for (const RigHead& rig_head : state.heads) {
    heads.push_back(rig_head.head);
    levels_rad.push_back(level_tilt_rad(rig_head.head));
  }
  WorldAtCamera world;
  world.world_from_old = cam_from_world(heads[0], Eigen::Vector2d::Zero());
  const std::vector<Head> written = reframed(heads, levels_rad);
  for (std::size_t h = 0; h < heads.size(); ++h) world.rig.heads.push_back({written[h], state.heads[h].camera});
  world.J = jacobian(problem, heads, levels_rad);
  world.rig.cov = world.J * cov * world.J.transpose();
  return world;
}

Eigen::Matrix<double, 6, Eigen::Dynamic> relative_jacobian(const Rig& rig, std::size_t first,
                                                           const Eigen::Vector2d& first_rad, std::size_t second,
                                                           const Eigen::Vector2d& second_rad) {
  constexpr double step = 1e-6;
  Eigen::Matrix<double, 6, Eigen::Dynamic> J = Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, rig.cov.rows());
  for (std::size_t h : {first, second}) {
    for (int param = 0; param < num_head_params; ++param) {
      const Eigen::Index col = num_head_params * static_cast<Eigen::Index>(h) + param;
      if (!(rig.cov(col, col) > 0.0)) continue;
      const auto pose = [&](double by) {
        const Head moved = retract(rig.heads[h].head, by * HeadVector::Unit(param));
        return cam_from_cam(first == h ? moved : rig.heads[first].head, first_rad,
                            second == h ? moved : rig.heads[second].head, second_rad);
      };
      J.col(col) = difference(pose(step), pose(-step)) / (2.0 * step);
    }
  }
  return J;
}

Eigen::Matrix<double, 6, 6> relative_covariance(const Rig& rig, std::size_t first, const Eigen::Vector2d& first_rad,
                                                std::size_t second, const Eigen::Vector2d& second_rad) {
  const auto J = relative_jacobian(rig, first, first_rad, second, second_rad);
  return J * rig.cov * J.transpose();
}

namespace {

/// σ of angle and position between cameras, the worst over the range of their views, or so much about its centre.
std::pair<double, double> worst_sigma(const RigReport& report, double min_rad) {
  const Rig& rig = report.rig;
  double angle2 = 0.0, length2 = 0.0;
  const bool is_one = rig.heads.size() == 1;
  const std::vector<Eigen::Vector2d> first_angles = angles_of(report.covers[0], min_rad);
  for (std::size_t h = is_one ? 0 : 1; h < rig.heads.size(); ++h) {
    for (const Eigen::Vector2d& first_rad : first_angles) {
      for (const Eigen::Vector2d& second_rad : angles_of(report.covers[h], min_rad)) {
        const Eigen::Matrix<double, 6, 6> cov = relative_covariance(rig, 0, first_rad, h, second_rad);
        length2 = std::max(length2, cov.topLeftCorner<3, 3>().trace());
        angle2 = std::max(angle2, cov.bottomRightCorner<3, 3>().trace());
      }
    }
  }
  return {std::sqrt(angle2), std::sqrt(length2)};
}

}  // namespace

void add_relative_sigma(RigReport& report) {
  std::tie(report.sigma_relative_rad, report.sigma_relative_m) = worst_sigma(report, 0.0);
  std::tie(report.sigma_span_rad, report.sigma_span_m) = worst_sigma(report, good_span_rad);
}

}  // namespace alidade
