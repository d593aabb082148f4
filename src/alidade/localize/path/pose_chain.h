#pragma once

#include <Eigen/Core>
#include <vector>

namespace alidade {

/// Normal equations of poses in a row, of which each shares factors with the two after it; of points, each of which is
/// seen from some of them; and of parameters that all share (a lens): the border. Poses are added in order and leave at
/// once, by Cholesky's elimination; a point enters before its first factor and leaves after its last pose has left. So
/// memory and time grow with the number of poses, and with the square of the points that are there at once. T. Barfoot,
/// "State Estimation for Robotics", 2017, §9.2: the arrowhead of bundle adjustment, with a motion's chain; what leaves
/// when: I. S. Duff & J. K. Reid, "The Multifrontal Solution of Indefinite
/// Sparse Symmetric Linear Equations", 1983.
class PoseChain {
 public:
  static constexpr int pose_dim = 6, window = 18;  ///< Components of a pose; of it and the two after it.

  /// Room for so many points at once.
  explicit PoseChain(int num_shared, int num_points = 0);

  /// Information of the pose that is next to leave, the two after it, and the border (what all share, then a place of
  /// three components for each point): J^T J and J^T r are added to these by whoever has factors. Of symmetric ones the
  /// lower half counts.
  Eigen::Matrix<double, window, window> A;
  Eigen::Matrix<double, window, Eigen::Dynamic> U;  ///< Window by border.
  Eigen::MatrixXd B;
  Eigen::Vector<double, window> a;
  Eigen::VectorXd b;
  /// B + weight · v vᵀ, in one pass with what leaves next.
  void add_square(const Eigen::VectorXd& v, double weight);

  /// Where in the border a point stands that enters. Points are counted from none, in any order.
  int enter(std::size_t point);
  /// False where nothing determines its position.
  [[nodiscard]] bool leave(std::size_t point);
  [[nodiscard]] int place_of(std::size_t point) const { return place_of_[point]; }
  /// The first pose of the window leaves. False where nothing determines it.
  [[nodiscard]] bool eliminate();

  /// Σ |L⁻¹ a|² of those that have left: what their steps gain in cost.
  [[nodiscard]] double gain() const;

  /// With the shared parameters at `shared`: every pose's step, and every point's, in order.
  struct Steps {
    std::vector<Eigen::Vector<double, pose_dim>> poses;
    std::vector<Eigen::Vector3d> points;
  };
  [[nodiscard]] Steps steps(const Eigen::VectorXd& shared) const;

  /// Covariance of each pose and point where that of the shared parameters is `shared_cov`, and how each pose moves
  /// with these of the shared parameters (`J_shared`: how they themselves move with them).
  struct Spread {
    std::vector<Eigen::Matrix<double, pose_dim, pose_dim>> cov;
    std::vector<Eigen::Matrix<double, pose_dim, Eigen::Dynamic>> J;
    std::vector<Eigen::Matrix3d> point_cov;
    std::vector<Eigen::Matrix<double, 3, Eigen::Dynamic>> point_J;
  };
  [[nodiscard]] Spread spread(const Eigen::MatrixXd& shared_cov, const Eigen::MatrixXd& J_shared) const;

  /// Σ W: the covariance of all poses and points with sums over the poses, W having six rows for each, and the points
  /// (three rows; empty: none); the first `num_solved` of the shared parameters are solved for, too, the others fixed.
  struct Columns {
    std::vector<Eigen::MatrixXd> poses, points;
  };
  [[nodiscard]] Columns solve(const Columns& W, int num_solved) const;

 private:
  static constexpr int rest_dim = window - pose_dim;
  enum class Event { entered, left, pose };
  /// What became of a point or a pose, with what remained of its equations: x = L⁻ᵀ (y − W_poses … − W_border …).
  struct Step {
    Event event = Event::pose;
    std::size_t index = 0;
    int place = 0;
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, pose_dim, pose_dim> L;
    Eigen::Matrix<double, Eigen::Dynamic, rest_dim, 0, pose_dim, rest_dim> W_poses;
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic> W_border;  ///< Of as much of it as was in use.
    Eigen::Vector<double, Eigen::Dynamic> y;
  };
  struct Backward;
  void take_out(const Step& step);
  void take_from_border(const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic>& W);
  [[nodiscard]] std::vector<Eigen::MatrixXd> forward(const Columns& W, Eigen::MatrixXd& border) const;

  int num_shared_ = 0, num_used_ = 0;  ///< Of the border.
  std::size_t num_poses_ = 0;
  std::vector<int> place_of_;  ///< Of each point.
  std::vector<bool> is_taken_;
  std::vector<Step> steps_;
  Eigen::VectorXd square_;  ///< That waits,
  double square_weight_ = 0.0;
  std::vector<double> left_, right_;  ///< In panels: what is multiplied for B.
};

}  // namespace alidade
