#include "alidade/localize/path/path_error.h"
#include "alidade/geometry/decompositions.h"

#include <algorithm>
#include <cmath>

namespace alidade {
namespace {

struct Pair {
  Rigid3 estimated, truth;
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();  ///< Of the estimated position.
};

/// RPE: between neighbours, with the aligned scale.
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

/// ATE, and what the covariances say of it.
void add_aligned(std::span<const Pair> pairs, const Similarity& fit, bool has_covs, PathError& error) {
  double sum2 = 0.0, variance_m2 = 0.0, nees = 0.0;
  for (const Pair& pair : pairs) {
    const Eigen::Vector3d moved =
        fit.b_from_a.rotation * (fit.scale * pair.estimated.translation) + fit.b_from_a.translation;
    const Eigen::Vector3d d = moved - pair.truth.translation;
    const Eigen::Matrix3d R = fit.scale * fit.b_from_a.rotation.toRotationMatrix();
    sum2 += d.squaredNorm();
    variance_m2 += fit.scale * fit.scale * pair.cov.trace();
    if (has_covs) nees += squared_mahalanobis(d, R * pair.cov * R.transpose());
  }
  const auto num = static_cast<double>(pairs.size());
  error.ate_m = std::sqrt(sum2 / num);
  if (!has_covs) return;
  error.stated_m = std::sqrt(variance_m2 / num);
  error.nees_per_dof = nees / (3.0 * num);
}

}  // namespace

const TimedPose* nearest_pose(std::span<const TimedPose> poses, double t_s, double tolerance_s) {
  auto at = std::ranges::lower_bound(poses, t_s, {}, &TimedPose::t_s);
  if (at != poses.begin() && (at == poses.end() || t_s - std::prev(at)->t_s < at->t_s - t_s)) --at;
  return at != poses.end() && std::abs(at->t_s - t_s) <= tolerance_s ? &*at : nullptr;
}

PathError path_error(std::span<const TimedPose> estimated, std::span<const TimedPose> truth, bool is_rigid,
                     std::span<const Eigen::Matrix3d> covs) {
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
  return error;
}

}  // namespace alidade
