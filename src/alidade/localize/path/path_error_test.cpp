#include "alidade/localize/path/path_error.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/testing/random.h"

namespace alidade {
namespace {

struct Paths {
  std::vector<TimedPose> estimated, truth;
};

/// A winding path and what an estimator may make of it: another frame, another scale, noise.
Paths noisy_paths(std::mt19937_64& rng, double scale, double sigma_m, bool in_another_frame = true) {
  std::normal_distribution<double> normal;
  const auto vector = [&] {
    const double x = normal(rng), y = normal(rng), z = normal(rng);
    return Eigen::Vector3d(x, y, z);
  };
  const Rigid3 map_from_world = in_another_frame ? Rigid3{exp_so3(vector()), vector()} : Rigid3{};
  Paths paths;
  for (int k = 0; k < 200; ++k) {
    const double t_s = 0.05 * k;
    const Rigid3 world_from_cam{exp_so3({0.3 * std::sin(t_s), 0.2 * t_s, 0.1}),
                                {std::sin(t_s), std::cos(0.7 * t_s), 0.3 * std::sin(1.3 * t_s)}};
    Rigid3 map_from_cam = map_from_world * world_from_cam;
    map_from_cam.translation = map_from_cam.translation / scale + sigma_m * vector();
    map_from_cam.rotation = map_from_cam.rotation * exp_so3(0.01 * vector());
    paths.truth.push_back({t_s, world_from_cam});
    paths.estimated.push_back({t_s, map_from_cam});
  }
  return paths;
}

/// The same alignment by another method: the rotation is the eigenvector of the largest eigenvalue of Horn's 4×4
/// matrix. B. K. P. Horn, "Closed-form solution of absolute orientation using unit quaternions", JOSA A 4(4), 1987.
double ate_by_horn(const Paths& paths, bool is_rigid) {
  Eigen::Vector3d mean_a = Eigen::Vector3d::Zero(), mean_b = Eigen::Vector3d::Zero();
  const auto num = static_cast<double>(paths.truth.size());
  for (std::size_t i = 0; i < paths.truth.size(); ++i) {
    mean_a += paths.estimated[i].world_from_cam.translation / num;
    mean_b += paths.truth[i].world_from_cam.translation / num;
  }
  Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
  double aa = 0.0;
  for (std::size_t i = 0; i < paths.truth.size(); ++i) {
    const Eigen::Vector3d a = paths.estimated[i].world_from_cam.translation - mean_a;
    M += a * (paths.truth[i].world_from_cam.translation - mean_b).transpose();
    aa += a.squaredNorm();
  }
  Eigen::Matrix4d N;
  N(0, 0) = M.trace();
  const Eigen::Vector3d z(M(1, 2) - M(2, 1), M(2, 0) - M(0, 2), M(0, 1) - M(1, 0));
  N.block<3, 1>(1, 0) = z;
  N.block<1, 3>(0, 1) = z.transpose();
  N.block<3, 3>(1, 1) = M + M.transpose() - M.trace() * Eigen::Matrix3d::Identity();
  const SymmetricEigen eigen = symmetric_eigen(N);
  const Eigen::Vector4d q = eigen.vectors.col(3);
  const Eigen::Matrix3d R = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
  const double scale = is_rigid ? 1.0 : (R * M).trace() / aa;
  double sum2 = 0.0;
  for (std::size_t i = 0; i < paths.truth.size(); ++i) {
    const Eigen::Vector3d a = paths.estimated[i].world_from_cam.translation - mean_a;
    const Eigen::Vector3d b = paths.truth[i].world_from_cam.translation - mean_b;
    sum2 += (scale * (R * a) - b).squaredNorm();
  }
  return std::sqrt(sum2 / num);
}

/// Translation of the relative error by 4×4 matrices.
double rpe_by_matrices(const Paths& paths, double scale) {
  const auto matrix = [](const Rigid3& b_from_a, double by) {
    Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
    T.topLeftCorner<3, 3>() = b_from_a.rotation.toRotationMatrix();
    T.topRightCorner<3, 1>() = by * b_from_a.translation;
    return T;
  };
  double sum2 = 0.0;
  for (std::size_t i = 1; i < paths.truth.size(); ++i) {
    const Eigen::Matrix4d P0 = matrix(paths.estimated[i - 1].world_from_cam, scale),
                          P1 = matrix(paths.estimated[i].world_from_cam, scale);
    const Eigen::Matrix4d Q0 = matrix(paths.truth[i - 1].world_from_cam, 1.0),
                          Q1 = matrix(paths.truth[i].world_from_cam, 1.0);
    const Eigen::Matrix4d E = (Q0.inverse() * Q1).inverse() * (P0.inverse() * P1);
    sum2 += E.topRightCorner<3, 1>().squaredNorm();
  }
  return std::sqrt(sum2 / static_cast<double>(paths.truth.size() - 1));
}

TEST(PathError, IsThatOfAnIndependentComputation) {
  auto rng = testing::make_rng();
  for (int k = 0; k < 20; ++k) {
    for (const bool is_rigid : {true, false}) {
      const Paths paths = noisy_paths(rng, is_rigid ? 1.0 : 2.7, 0.02);
      const PathError error = path_error(paths.estimated, paths.truth, is_rigid);
      EXPECT_NEAR(error.ate_m, ate_by_horn(paths, is_rigid), 1e-9);  // two closed forms: rounding
      EXPECT_NEAR(error.rpe_m, rpe_by_matrices(paths, error.scale), 1e-9);
      EXPECT_NEAR(error.scale, is_rigid ? 1.0 : 2.7, 0.2);
      EXPECT_EQ(error.num_pairs, 200u);
    }
  }
}

/// Errors as large as stated: the ratio is one, but for what the alignment of six numbers takes and 600 draws scatter.
TEST(PathError, StatesWhatSigmaSays) {
  auto rng = testing::make_rng();
  for (const double scale : {1.0, 2.7}) {
    const Paths paths = noisy_paths(rng, scale, 0.02);
    const std::vector<Eigen::Matrix<double, 6, 6>> covs(paths.estimated.size(),
                                                        0.02 * 0.02 * Eigen::Matrix<double, 6, 6>::Identity());
    const PathError error = path_error(paths.estimated, paths.truth, scale == 1.0, covs);
    EXPECT_NEAR(error.stated_m, scale * std::sqrt(3.0) * 0.02, 0.1 * error.stated_m);
    EXPECT_NEAR(error.ate_m / error.stated_m, 1.0, 0.1);
    EXPECT_NEAR(error.nees_aligned_per_dof, 1.0, 0.2) << "independent errors of a σ that is right, 600 of them less 7";
  }
  EXPECT_TRUE(std::isnan(path_error({}, {}, true).stated_m));
}

/// Poses that err as stated, in the truth's frame: 1, as 1200 independent numbers scatter; an alignment needs none of
/// it.
TEST(PathError, NeesIsThatOfThePosesWhereTheTruthIsInTheirFrame) {
  auto rng = testing::make_rng();
  Eigen::Vector<double, 6> sigma;
  sigma << 0.02, 0.02, 0.02, 0.01, 0.01, 0.01;
  const Eigen::Matrix<double, 6, 6> cov = sigma.cwiseAbs2().asDiagonal();
  const std::vector<Eigen::Matrix<double, 6, 6>> covs(200, cov), too_small(200, 0.04 * cov);
  const Paths paths = noisy_paths(rng, 1.0, 0.02, /*in_another_frame=*/false);
  EXPECT_NEAR(path_error(paths.estimated, paths.truth, true, covs).nees_per_dof, 1.0, 0.2);
  EXPECT_NEAR(path_error(paths.estimated, paths.truth, true, too_small).nees_per_dof, 25.0, 5.0);
  EXPECT_TRUE(std::isnan(path_error(paths.estimated, paths.truth, false, covs).nees_per_dof)) << "of no scale";
  const Paths other = noisy_paths(rng, 1.0, 0.02);
  EXPECT_TRUE(std::isnan(path_error(other.estimated, other.truth, true, covs).nees_per_dof));
}

/// Truth at 200 Hz: the pose of the frame's own time, not the first within the tolerance.
TEST(PathError, TakesTheNearestPoseOfTheTruth) {
  std::vector<TimedPose> truth;
  for (int i = 0; i < 100; ++i) truth.push_back({0.005 * i, Rigid3{Eigen::Quaterniond::Identity(), {1.0 * i, 0, 0}}});
  EXPECT_EQ(nearest_pose(truth, 0.1)->world_from_cam.translation.x(), 20.0);
  EXPECT_EQ(nearest_pose(truth, 0.1024)->world_from_cam.translation.x(), 20.0);
  EXPECT_EQ(nearest_pose(truth, 0.1026)->world_from_cam.translation.x(), 21.0);
  EXPECT_EQ(nearest_pose(truth, -0.011), nullptr);
  EXPECT_EQ(nearest_pose({}, 0.0), nullptr);
}

TEST(PathError, IsZeroForTheSamePathInAnotherFrameAndScale) {
  auto rng = testing::make_rng();
  Paths paths = noisy_paths(rng, 0.4, 0.0);
  EXPECT_LT(path_error(paths.estimated, paths.truth, false).ate_m, 1e-12);
  EXPECT_GT(path_error(paths.estimated, paths.truth, true).ate_m, 0.1);  // a rigid motion cannot take scale out
}

TEST(PathError, PairsByTimeAndSaysWhereThereIsNone) {
  auto rng = testing::make_rng();
  Paths paths = noisy_paths(rng, 1.0, 0.01);
  for (TimedPose& pose : paths.estimated) pose.t_s += 0.004;
  paths.estimated.erase(paths.estimated.begin() + 20, paths.estimated.begin() + 50);
  EXPECT_EQ(path_error(paths.estimated, paths.truth, true).num_pairs, 170u);
  for (TimedPose& pose : paths.estimated) pose.t_s += 1000.0;
  const PathError none = path_error(paths.estimated, paths.truth, true);
  EXPECT_EQ(none.num_pairs, 0u);
  EXPECT_TRUE(std::isnan(none.ate_m) && std::isnan(none.rpe_m));
  const std::vector<Eigen::Vector3d> line{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}};
  EXPECT_FALSE(aligned(line, line, true));  // the rotation about a line cannot be determined
}

}  // namespace
}  // namespace alidade
