#include "alidade/localize/path/path_error.h"
#include "alidade/geometry/decompositions.h"

#include <algorithm>
#include <cmath>

namespace alidade {
namespace {

struct Pair {
  Rigid3 estimated, truth;
  Eigen::Matrix<double, 6, 6> cov = Eigen::Matrix<double, 6, 6>::Zero();  ///< Of the right perturbation.

  [[nodiscard]] Eigen::Matrix3d position_cov() const {
    const Eigen::Matrix3d R = estimated.rotation.toRotationMatrix();
    return R * cov.topLeftCorner<3, 3>() * R.transpose();
  }
  [[nodiscard]] Eigen::Vector3d rotation_error() const {
    return log_so3(truth.rotation.conjugate() * estimated.rotation);
  }
};

/// RPE: between neighbours, with the scale of the alignment.
void add_steps(std::span<const Pair> pairs, PathError& error) {
  double steps2 = 0.0, turns2 = 0.0;
  for (std::size_t i = 1; i < pairs.size(); ++i) {
    Rigid3 step = pairs[i - 1].estimated.inverse() * pairs[i].estimated;
    step.translation *= error.scale;
    const Rigid3 true_step = pairs[i - 1].truth.inverse() * pairs[i].truth;
    const Rigid3 difference = true_step.inverse() * step;
    steps2 += difference.translation.squaredNorm();
    turns2 += log_so3(difference.rotation).squaredNorm();
  }
  const double num = static_cast<double>(pairs.size()) - 1.0;
  error.rpe_m = std::sqrt(steps2 / num);
  error.rpe_rad = std::sqrt(turns2 / num);
}

/// ATE, and its NEES by the covariances.
void add_aligned(std::span<const Pair> pairs, const Similarity& fit, bool has_covs, PathError& error) {
  double sum2 = 0.0, variance_m2 = 0.0, nees = 0.0;
  for (const Pair& pair : pairs) {
    const Eigen::Vector3d moved =
        fit.b_from_a.rotation * (fit.scale * pair.estimated.translation) + fit.b_from_a.translation;
    const Eigen::Vector3d d = moved - pair.truth.translation;
    const Eigen::Matrix3d R = fit.scale * fit.b_from_a.rotation.toRotationMatrix();
    sum2 += d.squaredNorm();
    const Eigen::Matrix3d cov = R * pair.position_cov() * R.transpose();
    variance_m2 += cov.trace();
    if (has_covs) nees += squared_mahalanobis(d, cov);
  }
  const auto num = static_cast<double>(pairs.size());
  error.ate_m = std::sqrt(sum2 / num);
  if (!has_covs) return;
  error.stated_m = std::sqrt(variance_m2 / num);
  error.nees_aligned_per_dof = nees / (3.0 * num);
}

/// Whether the truth is in the frame of the path: no farther away than errors explain.
bool is_in_one_frame(std::span<const Pair> pairs, const PathError& error) {
  constexpr double max_sigma = 10.0, max_of_size = 0.1, max_rotation_rad = 0.2;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Pair& pair : pairs) mean += pair.truth.translation / static_cast<double>(pairs.size());
  double size2 = 0.0, rotation2 = 0.0;
  for (const Pair& pair : pairs) {
    size2 += (pair.truth.translation - mean).squaredNorm();
    rotation2 += pair.rotation_error().squaredNorm();
  }
  const auto num = static_cast<double>(pairs.size());
  return error.unaligned_m <= std::max(max_sigma * error.stated_m, max_of_size * std::sqrt(size2 / num)) &&
         std::sqrt(rotation2 / num) <= max_rotation_rad;
}

double nees_of_poses(std::span<const Pair> pairs) {
  double sum = 0.0;
  for (const Pair& pair : pairs) {
    Eigen::Vector<double, 6> d;
    d << pair.estimated.rotation.conjugate() * (pair.estimated.translation - pair.truth.translation),
        pair.rotation_error();
    sum += squared_mahalanobis(d, pair.cov);
  }
  return sum / (6.0 * static_cast<double>(pairs.size()));
}

}  // namespace

const TimedPose* nearest_pose(std::span<const TimedPose> poses, double t_s, double tolerance_s) {
  auto at = std::ranges::lower_bound(poses, t_s, {}, &TimedPose::t_s);
  if (at != poses.begin() && (at == poses.end() || t_s - std::prev(at)->t_s < at->t_s - t_s)) --at;
  return at != poses.end() && std::abs(at->t_s - t_s) <= tolerance_s ? &*at : nullptr;
}

PathError path_error(std::span<const TimedPose> estimated, std::span<const TimedPose> truth, bool is_rigid,
                     std::span<const Eigen::Matrix<double, 6, 6>> covs) {
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i < estimated.size(); ++i) {
    const TimedPose* const there = nearest_pose(truth, estimated[i].t_s);
    if (there == nullptr) continue;
    pairs.push_back({estimated[i].world_from_cam, there->world_from_cam});
    if (!covs.empty()) pairs.back().cov = covs[i];
  }
  PathError error;
  error.num_pairs = pairs.size();
  if (pairs.empty()) return error;
  const auto num = static_cast<double>(pairs.size());
  std::vector<Eigen::Vector3d> a, b;
  double sum2 = 0.0;
  for (const Pair& pair : pairs) {
    a.push_back(pair.estimated.translation);
    b.push_back(pair.truth.translation);
    sum2 += (a.back() - b.back()).squaredNorm();
  }
  error.unaligned_m = std::sqrt(sum2 / num);
  const auto fit = aligned(a, b, is_rigid);
  if (!fit) return error;
  error.scale = fit->scale;
  add_aligned(pairs, *fit, !covs.empty(), error);
  add_steps(pairs, error);
  if (is_rigid && !covs.empty() && is_in_one_frame(pairs, error)) error.nees_per_dof = nees_of_poses(pairs);
  return error;
}

}  // namespace alidade
