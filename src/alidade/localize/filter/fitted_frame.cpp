#include "alidade/localize/filter/fitted_frame.h"

#include <Eigen/Cholesky>
#include <cmath>

#include "alidade/geometry/rigid3.h"
#include "alidade/localize/filter/filter.h"

namespace alidade {
namespace {

bool counts(const Feature& feature) { return feature.is_known && feature.was_used; }

/// Weighted mean of the known points that were used; returns their number.
int centre_of(std::span<const Feature> features, Eigen::Vector3d& centre) {
  double sum = 0.0;
  int num = 0;
  centre.setZero();
  for (const Feature& feature : features) {
    if (!counts(feature)) continue;
    const double weight = 1.0 / (feature.sigma_given_m * feature.sigma_given_m);
    centre += weight * feature.values.head<3>();
    sum += weight;
    ++num;
  }
  if (num > 0) centre /= sum;
  return num;
}

}  // namespace

Feature FittedFrame::operator*(const Feature& feature) const {
  Feature moved = feature;
  moved.values.head<3>() = *this * feature.values.head<3>().eval();
  if (feature.kind == FeatureKind::xyz) return moved;
  const AnglesOfBearing angles = angles_of(G * bearing_of(feature.values[3], feature.values[4]).m);
  moved.values.tail<3>() << angles.theta, angles.phi, feature.values[5] / s;
  return moved;
}

Eigen::Matrix3d FittedFrame::J_angles(const Feature& feature) const {
  const BearingAngles was = bearing_of(feature.values[3], feature.values[4]);
  const AnglesOfBearing is = angles_of(G * was.m);
  Eigen::Matrix3d J = Eigen::Matrix3d::Zero();
  J.block<2, 1>(0, 0) = is.J * G * was.m_theta;
  J.block<2, 1>(0, 1) = is.J * G * was.m_phi;
  J(2, 2) = 1.0 / s;
  return J;
}

std::optional<FittedFrame> fitted_frame(std::span<const Feature> features) {
  FittedFrame frame;
  if (centre_of(features, frame.centre) < 3) return std::nullopt;
  Eigen::Matrix<double, 7, 7> information = Eigen::Matrix<double, 7, 7>::Zero();  // order: shift, rotation, ln s
  Eigen::Vector<double, 7> rhs = Eigen::Vector<double, 7>::Zero();
  for (const Feature& feature : features) {
    if (!counts(feature)) continue;
    const Eigen::Vector3d arm = feature.values.head<3>() - frame.centre;
    Eigen::Matrix<double, 3, 7> J;
    J << Eigen::Matrix3d::Identity(), -cross_matrix(arm), arm;
    const double weight = 1.0 / (feature.sigma_given_m * feature.sigma_given_m);
    information += weight * J.transpose() * J;
    rhs += weight * J.transpose() * (feature.given_in_world - feature.values.head<3>());
  }
  const Eigen::LDLT<Eigen::Matrix<double, 7, 7>> ldlt(information);
  constexpr double vague = 0.1;  // rad, or relative scale: beyond it a linear step is not valid
  const Eigen::Matrix<double, 7, 7> cov = ldlt.solve(Eigen::Matrix<double, 7, 7>::Identity());
  if (ldlt.info() != Eigen::Success || !cov.allFinite()) return std::nullopt;
  const Eigen::Vector4d variances = cov.diagonal().tail<4>();
  if (!(variances.minCoeff() > 0.0 && variances.maxCoeff() < vague * vague)) return std::nullopt;
  const Eigen::Vector<double, 7> step = cov * rhs;
  frame.shift = step.head<3>();
  frame.G = exp_so3(step.segment<3>(3)).toRotationMatrix();
  frame.s = std::exp(step[6]);
  frame.chi2 = step.dot(rhs);
  return frame;
}

void LocalizationFilter::note_used() {
  for (const Measured* measured : used_)
    features_[static_cast<std::size_t>(measured->feature - features_.data())].was_used = true;
}

void LocalizationFilter::fit_frame() {
  constexpr double noticeable = 0.01;  // (0.1 σ)²
  const auto frame = fitted_frame(features_);
  if (frame && frame->chi2 > noticeable) transform(*frame);
}

/// Transforms the state and the errors of its covariance. Known points without any used observation return to their
/// given positions.
void LocalizationFilter::transform(const FittedFrame& frame) {
  const auto block = [&](int row) { return shear_.block<3, 3>(row, 0); };
  Rigid3& world_from_cam = motion_.world_from_cam;
  world_from_cam.translation = frame * world_from_cam.translation;
  world_from_cam.rotation = (Eigen::Quaterniond(frame.G) * world_from_cam.rotation).normalized();
  motion_.velocity_in_world = frame.s * frame.G * motion_.velocity_in_world;
  block(0) = block(6) = frame.s * frame.G;
  block(3) = block(9) = Eigen::Matrix3d::Identity();
  for (Feature& feature : features_) {
    const bool stays = feature.is_known && !feature.was_used;
    block(feature.offset) = stays ? Eigen::Matrix3d::Identity().eval() : (frame.s * frame.G).eval();
    if (feature.dim() > 3) block(feature.offset + 3) = frame.J_angles(feature);
    if (!stays) feature = frame * feature;
  }
  P_.turn(shear_.data(), motion_dim, num_lens());
  given_.turn(shear_.data(), P_.capacity(), motion_dim, num_lens(), P_.dim());
}

}  // namespace alidade
