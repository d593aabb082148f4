#pragma once

#include <vector>

#include "alidade/observe/frame_buffer.h"
#include "alidade/observe/solve/bundle_normal.h"

namespace alidade {

/// For adjustments with estimated rotations: how rotations and points follow changes of other parameters, the columns
/// of J. All are eliminated together, with the weights of the residuals and the prior of the rotations.
class EliminatedRotations {
 public:
  EliminatedRotations(const Adjustment& reference, Eigen::Index num_columns);

  /// Adds the derivatives of an observation: by the columns, by the rotation of its frame, by its point.
  void add(const BundleObservation& seen, double weight, const Eigen::Ref<const Eigen::MatrixXd>& J,
           const Eigen::Matrix<double, 2, 3>& by_rotation, const Eigen::Matrix<double, 2, 3>& by_point);
  /// To be called after the last add().
  void solve();

  /// Derivatives of an observation by the columns, with its rotation and its point eliminated.
  [[nodiscard]] Eigen::MatrixXd followed(const BundleObservation& seen, const Eigen::Ref<const Eigen::MatrixXd>& J,
                                         const Eigen::Matrix<double, 2, 3>& by_rotation,
                                         const Eigen::Matrix<double, 2, 3>& by_point) const;
  /// Adds the contribution of a frame's rotation prior to gradient and information of the columns.
  void add_prior(int frame, Eigen::VectorXd& gradient, Eigen::MatrixXd& information) const;
  /// Whether rotations can reproduce the effect of this column entirely, so that it is unobservable.
  [[nodiscard]] bool is_absorbed(Eigen::Index column, double information) const;

 private:
  const BundleSolution& solution_;
  BundleNormal normal_;    ///< Normal equations, without the columns' own information.
  BundleSlopes slopes_;    ///< Change of points and rotations per unit of the columns.
  Eigen::VectorXd alone_;  ///< Information of each column without elimination.
};

/// Whether each frame's rotation was estimated.
[[nodiscard]] bool has_rotations(const BundleSolution& solution);

/// The frame with its estimated rotation, if that was estimated.
[[nodiscard]] RotationFrame rotated_frame(const Adjustment& reference, int frame);

}  // namespace alidade
