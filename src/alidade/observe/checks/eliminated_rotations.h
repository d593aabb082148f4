#pragma once

#include <vector>

#include "alidade/observe/frame_buffer.h"
#include "alidade/observe/solve/bundle_normal.h"

namespace alidade {

/// Where each frame's rotation is estimated as well: how rotations and points of an adjustment follow other parameters,
/// the columns of J. All are eliminated together, with the residuals' weights and the prior of the rotations.
class EliminatedRotations {
 public:
  EliminatedRotations(const Adjustment& reference, Eigen::Index num_columns);

  /// An observation's derivatives: by the columns, by its frame's rotation, by its point.
  void add(const BundleObservation& seen, double weight, const Eigen::Ref<const Eigen::MatrixXd>& J,
           const Eigen::Matrix<double, 2, 3>& by_rotation, const Eigen::Matrix<double, 2, 3>& by_point);
  /// After all of them.
  void solve();

  /// Derivatives of an observation by the columns, with its rotation and its point following.
  [[nodiscard]] Eigen::MatrixXd followed(const BundleObservation& seen, const Eigen::Ref<const Eigen::MatrixXd>& J,
                                         const Eigen::Matrix<double, 2, 3>& by_rotation,
                                         const Eigen::Matrix<double, 2, 3>& by_point) const;
  /// What the prior of a frame's rotation adds to gradient and information of the columns.
  void add_prior(int frame, Eigen::VectorXd& gradient, Eigen::MatrixXd& information) const;
  /// Rotations can do all that this column does: nothing distinguishes them.
  [[nodiscard]] bool is_absorbed(Eigen::Index column, double information) const;

 private:
  const BundleSolution& solution_;
  BundleNormal normal_;    ///< Of the columns but for their own information, which is not needed.
  BundleSlopes slopes_;    ///< How points and rotations follow the columns.
  Eigen::VectorXd alone_;  ///< Information of each column if nothing followed it.
};

/// Each frame's rotation was estimated.
[[nodiscard]] bool has_rotations(const BundleSolution& solution);

/// A frame with its rotation as estimated, where it was.
[[nodiscard]] RotationFrame rotated_frame(const Adjustment& reference, int frame);

}  // namespace alidade
