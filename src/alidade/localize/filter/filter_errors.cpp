#include <cmath>

#include "alidade/localize/filter/filter.h"
#include "alidade/localize/filter/world_rotation.h"

// The error state: how observations depend on it, and how the nominal state absorbs it. See world_rotation.h.

namespace alidade {
namespace {

double& lens_param(Camera& camera, int index) {
  return std::visit([index](auto& lens) -> double& { return lens.params[index]; }, camera.lens);
}

}  // namespace

/// Pose and feature displaced by the current delta_ of an update.
struct LocalizationFilter::Moved {
  Rigid3 world_from_cam;
  Feature feature;
};

/// The displaced lens is written to `camera_at_delta_`.
LocalizationFilter::Moved LocalizationFilter::moved_by_delta(const Measured& measured, const WorldRotation& turn) {
  const Feature& nominal = *measured.feature;
  Moved moved{motion_.world_from_cam, nominal};
  auto& [world_from_cam, feature] = moved;
  if (turns_world_) {  // the camera keeps its attitude: no measurement depends on the rotation of the world
    world_from_cam.translation = turn.position_before(world_from_cam.translation, delta_.head<3>());
    feature = turn.feature_before(nominal, error_of(nominal), measured.J_before);
  } else {
    world_from_cam.translation += delta_.head<3>();
    world_from_cam.rotation = (world_from_cam.rotation * exp_so3(delta_.segment<3>(3))).normalized();
    for (int i = 0; i < feature.dim(); ++i) feature.values[i] += delta_[feature.offset + i];
  }
  if (scale_at_) {  // the second bracket of world_scale.h
    world_from_cam.translation -= delta_[*scale_at_] * motion_.world_from_cam.translation;
    feature.values -= delta_[*scale_at_] * scale_direction(nominal);
  }
  for (int k = 0; k < num_lens(); ++k) {
    const int index = config_.lens_params[static_cast<std::size_t>(k)];
    lens_param(camera_at_delta_, index) = lens_param(camera_, index) + delta_[motion_dim + k];
  }
  return moved;
}

Eigen::Matrix<double, 2, 3> LocalizationFilter::J_px_rotation(const ExpectedView& view, const Measured& measured,
                                                              const Moved& moved, const WorldRotation& turn) const {
  const Eigen::Matrix3d p_cross = cross_matrix(motion_.world_from_cam.translation);
  if (turns_world_)
    return (view.J_px_pose.leftCols<3>() * p_cross + view.J_px_feature * measured.J_before) * turn.world_from_cam();
  const Eigen::Matrix3d J = right_jacobian(delta_.segment<3>(3));
  Eigen::Matrix<double, 2, 3> J_rotation = view.J_px_pose.rightCols<3>() * J;
  if (config_.holds_frame) {  // errors refer to the state at which the update began
    const Eigen::Matrix3d R = turn.world_from_cam(), RJ = R * J.transpose();
    J_rotation += view.J_px_pose.leftCols<3>() * (p_cross * R - cross_matrix(moved.world_from_cam.translation) * RJ);
    J_rotation += view.J_px_feature * (measured.J_before * R - J_before_rotation(moved.feature) * RJ);
  }
  return J_rotation;
}

/// Stores the observation's Jacobian as its non-zero columns.
void LocalizationFilter::put_columns(const ExpectedView& view, const Eigen::Matrix<double, 2, 3>& J_rotation,
                                     const Moved& moved, Measured& measured) const {
  const auto& [world_from_cam, feature] = moved;
  int n = 0;
  const auto put = [&](int column, double d0, double d1) {
    const auto at = static_cast<std::size_t>(n++);
    measured.columns[at] = column;
    measured.h0[at] = d0;
    measured.h1[at] = d1;
  };
  for (int i = 0; i < 3; ++i) put(i, view.J_px_pose(0, i), view.J_px_pose(1, i));
  for (int i = 0; i < 3; ++i) put(3 + i, J_rotation(0, i), J_rotation(1, i));
  for (int k = 0; k < num_lens(); ++k) {
    const int index = config_.lens_params[static_cast<std::size_t>(k)];
    put(motion_dim + k, view.J_px_lens(0, index), view.J_px_lens(1, index));
  }
  for (int i = 0; i < feature.dim(); ++i) put(feature.offset + i, view.J_px_feature(0, i), view.J_px_feature(1, i));
  if (scale_at_) {
    const Eigen::Vector2d J_scale =
        view.J_px_pose.leftCols<3>() * (world_from_cam.translation - motion_.world_from_cam.translation) +
        view.J_px_feature * (scale_direction(feature) - scale_direction(*measured.feature));
    put(*scale_at_, J_scale.x(), J_scale.y());
  }
  measured.num_support = n;
}

bool LocalizationFilter::linearise(Measured& measured) {
  const WorldRotation turn(motion_.world_from_cam, delta_.segment<3>(3));
  const Moved moved = moved_by_delta(measured, turn);
  const auto view = expected_view(num_lens() ? camera_at_delta_ : camera_, moved.world_from_cam, moved.feature);
  if (!view) return false;
  measured.nu = measured.px - view->px;
  put_columns(*view, J_px_rotation(*view, measured, moved, turn), moved, measured);
  measured.c = measured.nu;
  for (std::size_t k = 0; k < static_cast<std::size_t>(measured.num_support); ++k)
    measured.c += delta_[measured.columns[k]] * Eigen::Vector2d(measured.h0[k], measured.h1[k]);
  return true;
}

std::span<const double> LocalizationFilter::error_of(const Feature& feature) const {
  return {delta_.data() + feature.offset, static_cast<std::size_t>(feature.dim())};
}

/// Moves the state by delta_ and re-references the errors to the new state: world_rotation.h.
void LocalizationFilter::turn_by_delta() {
  const WorldRotation turn(motion_.world_from_cam, delta_.segment<3>(3));
  const Eigen::Matrix3d G = turn.G(), J_left = right_jacobian(-turn.xi()), R = turn.world_from_cam();
  const CameraMotion was = motion_;
  motion_ = retract(was, delta_.head<motion_dim>());
  motion_.world_from_cam.translation = G * turn.position_before(was.world_from_cam.translation, delta_.head<3>());
  motion_.velocity_in_world = G * turn.position_before(was.velocity_in_world, delta_.segment<3>(6));
  // First rotate each error with its position, then add the contribution of the rotation error.
  const auto block = [&](int row) { return shear_.block<3, 3>(row, 0); };
  block(0) = block(6) = G;
  block(3) = block(9) = Eigen::Matrix3d::Identity();
  for (const Feature& feature : features_) {
    block(feature.offset) = G;
    if (feature.dim() > 3)
      block(feature.offset + 3) = WorldRotation::J_rotated_angles(G, turn.feature_before(feature, error_of(feature)));
  }
  P_.turn(shear_.data(), motion_dim, num_lens());
  given_.turn(shear_.data(), P_.capacity(), motion_dim, num_lens(), P_.dim());
  const auto added = [&](const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
    return ((G * cross_matrix(from) - cross_matrix(to) * J_left) * R).eval();
  };
  shear_.topRows(motion_dim + num_lens()).setZero();
  block(0) = added(was.world_from_cam.translation, motion_.world_from_cam.translation);
  block(3) = motion_.world_from_cam.rotation.toRotationMatrix().transpose() * J_left * R - Eigen::Matrix3d::Identity();
  block(6) = added(was.velocity_in_world, motion_.velocity_in_world);
  for (Feature& feature : features_) {
    const Feature before = feature;
    const Eigen::Matrix<double, 6, 3> J_before = J_before_rotation(before);
    feature = WorldRotation::turned(G, turn.feature_before(before, error_of(before), J_before));
    block(feature.offset) = added(before.values.head<3>(), feature.values.head<3>());
    if (feature.dim() < 6) continue;
    const Eigen::Matrix3d J_rotated = block(feature.offset + 3);  // the block of turn(), not overwritten yet
    block(feature.offset + 3) =
        (J_rotated * J_before.bottomRows<3>() - J_before_rotation(feature).bottomRows<3>() * J_left) * R;
  }
  constexpr int rotation_at = 3;
  P_.shear(rotation_at, shear_.data());
  given_.shear(rotation_at, shear_.data(), P_.capacity(), P_.dim());
}

/// Moves the state by delta_ and re-references the errors of the covariance: the rotation's by the right Jacobian,
/// the others such that a rotation of the world remains one.
void LocalizationFilter::move_by_delta() {
  constexpr int rotation_at = 3;
  const Eigen::Matrix3d J = right_jacobian(delta_.segment<3>(rotation_at));
  const CameraMotion was = motion_;
  motion_ = retract(was, delta_.head<motion_dim>());
  const Eigen::Matrix3d R = was.world_from_cam.rotation.toRotationMatrix(), RJ = R * J.transpose();
  const bool holds = config_.holds_frame;
  const auto shift = [&](const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
    return (cross_matrix(from) * R - cross_matrix(to) * RJ).eval();
  };
  shear_.topRows(P_.dim()).setZero();
  shear_.middleRows<3>(rotation_at) = J - Eigen::Matrix3d::Identity();
  if (holds) {
    shear_.topRows<3>() = shift(was.world_from_cam.translation, motion_.world_from_cam.translation);
    shear_.middleRows<3>(6) = shift(was.velocity_in_world, motion_.velocity_in_world);
  }
  for (Feature& feature : features_) {
    const Feature before = feature;
    for (int i = 0; i < feature.dim(); ++i) feature.values[i] += delta_[feature.offset + i];
    if (holds)
      shear_.middleRows(feature.offset, feature.dim()) =
          (J_before_rotation(before) * R - J_before_rotation(feature) * RJ).topRows(feature.dim());
  }
  P_.shear(rotation_at, shear_.data());
  given_.shear(rotation_at, shear_.data(), P_.capacity(), P_.dim());
}

/// Updates the sensitivity to the given numbers with the used observations, linearised at the updated state.
void LocalizationFilter::count_given() {
  if (given_.num() == 0 || used_.empty()) return;
  for (const Measured* measured : used_) {
    const auto view = expected_view(camera_, motion_.world_from_cam, *measured->feature);
    if (view)
      given_.add_observation(*view, *measured->feature, config_.lens_params, measured->px - view->px,
                             measured->variance_px2);
  }
  given_.finish(P_);
}

void LocalizationFilter::move_lens_by_delta() {
  for (int k = 0; k < num_lens(); ++k) {
    const int index = config_.lens_params[static_cast<std::size_t>(k)];
    lens_param(camera_, index) += delta_[motion_dim + k];
  }
}

}  // namespace alidade
