#include "alidade/pantilt/rig_uncertainty.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

Eigen::Index num_lens_params(const RigHead& head) { return params(head.camera.lens).size(); }

/// Where the lens of a head begins behind the parameters of all heads.
Eigen::Index first_of_lens(const Rig& rig, std::size_t head) {
  Eigen::Index first = num_head_params * static_cast<Eigen::Index>(rig.heads.size());
  for (std::size_t h = 0; h < head; ++h) first += num_lens_params(rig.heads[h]);
  return first;
}

/// A square root of a covariance, its columns the directions of error: cov = L Lᵀ, by what is left of it after scaling
/// to σ = 1, since metres, radians and distortions differ by many decades.
Eigen::MatrixXd root_of(const Eigen::MatrixXd& cov) {
  constexpr double least = 1e-9;
  const Eigen::VectorXd sigma = cov.diagonal().cwiseMax(0.0).cwiseSqrt();
  const Eigen::VectorXd scale = sigma.unaryExpr([](double s) { return s > 0.0 ? 1.0 / s : 0.0; });
  const SymmetricEigen parts = symmetric_eigen(scale.asDiagonal() * cov * scale.asDiagonal());
  const auto kept = static_cast<Eigen::Index>(std::count_if(
      parts.values.data(), parts.values.data() + parts.values.size(), [](double value) { return value > least; }));
  return sigma.asDiagonal() * parts.vectors.rightCols(kept) *
         parts.values.tail(kept).cwiseSqrt().asDiagonal();  // values ascend
}

/// What each direction does to the pixel of a point that goes 1 m/s, squared and added.
void add_effect(const Camera& camera, const TurnedHead& turned, const Eigen::Vector3d& point_in_cam,
                const Eigen::MatrixXd& factor, Eigen::MatrixXd& sum, double& num) {
  const auto seen = project_with_jacobians(camera, point_in_cam);
  if (!seen) return;
  Eigen::MatrixXd J(2, factor.rows());
  J << seen->J_px_point * turned.J_point_head(point_in_cam), seen->J_px_params,
      seen->J_px_point * turned.cam_from_world_rotation.col(0);
  const Eigen::MatrixXd effect = J * factor;
  sum.noalias() += effect.transpose() * effect;
  num += 1.0;
}

/// The same over a head's working space.
void add_effects(const RigHead& rig_head, const Eigen::MatrixXd& factor, Eigen::MatrixXd& sum, double& num) {
  const Camera& camera = rig_head.camera;
  const Eigen::Vector2d size_px(camera.width_px, camera.height_px);
  const std::array<Eigen::Vector2d, 5> places{{{0.5, 0.5}, {0.2, 0.2}, {0.8, 0.2}, {0.2, 0.8}, {0.8, 0.8}}};
  for (const Eigen::Vector2d& place : places) {
    const auto ray = unproject(camera, place.cwiseProduct(size_px));
    if (!ray) continue;
    for (const double pan_rad : {-0.7, 0.0, 0.7})
      for (const double tilt_rad : {-0.3, 0.3})
        for (const double range_m : {0.5, 2.0, 12.0})
          add_effect(camera, TurnedHead(rig_head.head, {pan_rad, tilt_rad}), range_m * *ray, factor, sum, num);
  }
}

}  // namespace

Eigen::MatrixXd joint_covariance(const Rig& rig) {
  const auto num_heads = static_cast<Eigen::Index>(rig.heads.size()) * num_head_params;
  const Eigen::Index size = first_of_lens(rig, rig.heads.size());
  Eigen::MatrixXd cov = Eigen::MatrixXd::Zero(size, size);
  if (rig.cov_with_lenses.rows() == size) {
    cov = rig.cov_with_lenses;
  } else {
    if (rig.cov.rows() == num_heads) cov.topLeftCorner(num_heads, num_heads) = rig.cov;
    for (std::size_t h = 0; h < rig.heads.size(); ++h) {
      const Eigen::Index first = first_of_lens(rig, h), num = num_lens_params(rig.heads[h]);
      if (rig.heads[h].camera.cov.rows() == num) cov.block(first, first, num, num) = rig.heads[h].camera.cov;
    }
  }
  for (std::size_t h = 0; h < rig.encoder_errors.size() && h < rig.heads.size(); ++h) {
    const EncoderError& error = rig.encoder_errors[h];
    const Eigen::Index first = num_head_params * static_cast<Eigen::Index>(h);
    for (int axis = 0; axis < 2; ++axis) {
      double &zero = cov(first + 15 + axis, first + 15 + axis), &scale = cov(first + 17 + axis, first + 17 + axis);
      if (!(zero > 0.0) && error.sigma_zero_rad > 0.0) zero = error.sigma_zero_rad * error.sigma_zero_rad;
      if (!(scale > 0.0) && error.sigma_scale > 0.0) scale = error.sigma_scale * error.sigma_scale;
    }
  }
  return cov;
}

RigUncertainty rig_uncertainty(const Rig& rig, double sigma_clock_s) {
  const Eigen::MatrixXd joint = joint_covariance(rig);
  const bool has_clocks = sigma_clock_s > 0.0 && rig.heads.size() > 1;
  if (joint.isZero(0.0) && !has_clocks) return {};
  const Eigen::MatrixXd root = root_of(joint);
  const auto num_clocks = has_clocks ? static_cast<Eigen::Index>(rig.heads.size()) : 0;
  std::vector<Eigen::MatrixXd> factor;
  for (std::size_t h = 0; h < rig.heads.size(); ++h) {
    const Eigen::Index lens = num_lens_params(rig.heads[h]), own = num_head_params * static_cast<Eigen::Index>(h);
    Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(num_head_params + lens + 1, root.cols() + num_clocks);
    rows.topLeftCorner(num_head_params, root.cols()) = root.middleRows(own, num_head_params);
    rows.block(num_head_params, 0, lens, root.cols()) = root.middleRows(first_of_lens(rig, h), lens);
    if (has_clocks) rows(num_head_params + lens, root.cols() + static_cast<Eigen::Index>(h)) = sigma_clock_s;
    factor.push_back(std::move(rows));
  }
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(factor.front().cols(), factor.front().cols());
  double num = 0.0;
  for (std::size_t h = 0; h < rig.heads.size(); ++h) add_effects(rig.heads[h], factor[h], sum, num);
  constexpr double min_px2 = 1e-4;
  const SymmetricEigen parts = symmetric_eigen(sum / std::max(1.0, num));
  Eigen::Index dropped = 0;
  for (double left = 0.0; dropped < parts.values.size(); ++dropped)
    if ((left += std::max(0.0, parts.values[dropped])) > min_px2) break;
  const Eigen::Index kept = std::min<Eigen::Index>(parts.values.size() - dropped, max_rig_errors);
  RigUncertainty uncertainty;
  if (kept == 0) return uncertainty;
  for (const Eigen::MatrixXd& rows : factor) uncertainty.factor.emplace_back(rows * parts.vectors.rightCols(kept));
  return uncertainty;
}

std::optional<RigParamEffect> rig_param_effect(const TurnedHead& turned, const Camera& camera,
                                               const Eigen::Vector3d& point_in_world,
                                               const Eigen::Vector3d& velocity_in_world,
                                               const std::optional<ObservationLens>& lens) {
  const Eigen::Vector3d point_in_cam = turned.point_in_cam(point_in_world);
  const auto seen = project_with_jacobians(camera, point_in_cam);
  if (!seen) return std::nullopt;
  RigParamEffect J(2, num_head_params + seen->J_px_params.cols() + 1);
  J.leftCols<num_head_params>() = seen->J_px_point * turned.J_point_head(point_in_cam);
  J.middleCols(num_head_params, seen->J_px_params.cols()) = seen->J_px_params;
  J.rightCols<1>() = seen->J_px_point * (turned.cam_from_world_rotation * velocity_in_world);
  if (lens) {
    J.middleCols<4>(num_head_params) *= lens->error_scale.asDiagonal();
    J = Zoomed(camera, lens->k).ratio.asDiagonal() * J;
  }
  return J;
}

std::optional<RigErrorEffect> rig_error_effect(const Eigen::MatrixXd& factor, const TurnedHead& turned,
                                               const Camera& camera, const Eigen::Vector3d& point_in_world,
                                               const Eigen::Vector3d& velocity_in_world,
                                               const std::optional<ObservationLens>& lens) {
  const auto J = rig_param_effect(turned, camera, point_in_world, velocity_in_world, lens);
  if (!J) return std::nullopt;
  RigErrorEffect effect(2, factor.cols());
  effect.noalias() = J->lazyProduct(factor);
  return effect;
}

}  // namespace alidade
