#pragma once

#include <Eigen/Core>
#include <vector>

namespace alidade {

/// Normal equations of poses in a row, of which each shares factors with the two after it, and of numbers that all
/// share (points, a lens): the border. Poses are added in order and leave at once, by Cholesky's elimination, so that
/// memory and time grow with their number, and with the border's square. T. Barfoot, "State Estimation for Robotics",
/// 2017, §9.2: the arrowhead of bundle adjustment, with a motion's chain.
class PoseChain {
 public:
  static constexpr int pose_dim = 6, window = 18;  ///< Numbers of a pose; of it and the two after it.

  explicit PoseChain(int border_dim);

  /// Information of the pose that is next to leave, the two after it, and the border: J^T J and J^T r are added to
  /// these by whoever has factors. Of symmetric ones the lower half counts.
  Eigen::Matrix<double, window, window> A;
  Eigen::Matrix<double, window, Eigen::Dynamic> U;  ///< Window by border.
  Eigen::MatrixXd B;
  Eigen::Vector<double, window> a;
  Eigen::VectorXd b;

  /// The first pose of the window leaves. False where nothing tells it.
  [[nodiscard]] bool eliminate();

  /// Σ |L⁻¹ a|² of those that have left: what their steps gain in cost.
  [[nodiscard]] double gain() const;

  /// With the border at `border`: every pose's step, in order.
  [[nodiscard]] std::vector<Eigen::Vector<double, pose_dim>> steps(const Eigen::VectorXd& border) const;

  /// Covariance of each pose where the border's is `border_cov`, and how each moves with these of the border's columns
  /// (`J_border`: how the border itself moves with them).
  struct Spread {
    std::vector<Eigen::Matrix<double, pose_dim, pose_dim>> cov;
    std::vector<Eigen::Matrix<double, pose_dim, Eigen::Dynamic>> J;
  };
  [[nodiscard]] Spread spread(const Eigen::MatrixXd& border_cov, const Eigen::MatrixXd& J_border) const;

 private:
  struct Left {
    Eigen::Matrix<double, pose_dim, pose_dim> L;
    Eigen::Matrix<double, pose_dim, window - pose_dim> W_poses;
    Eigen::Matrix<double, pose_dim, Eigen::Dynamic> W_border;
    Eigen::Vector<double, pose_dim> y;
  };
  std::vector<Left> left_;
};

}  // namespace alidade
