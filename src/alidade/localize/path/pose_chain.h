#pragma once

#include <Eigen/Core>
#include <vector>

namespace alidade {

/// Normal equations of a sequence of poses, each of which shares factors with the next two; of points, each observed
/// from some of the poses; and of parameters shared by all (a lens): the border. Poses are added in order and
/// eliminated at once, by Cholesky elimination; a point enters before its first factor and is eliminated after its last
/// pose. So memory and time grow linearly with the number of poses, and with the square of the number of simultaneous
/// points. T. Barfoot, "State Estimation for Robotics", 2017, §9.2: the arrowhead of bundle adjustment, with a motion
/// chain; elimination order: I. S. Duff & J. K. Reid, "The Multifrontal Solution of Indefinite Sparse Symmetric Linear
/// Equations", 1983.
class PoseChain {
 public:
  static constexpr int pose_dim = 6, window = 18;  ///< Components of a pose; of it and the next two.

  /// Reserves room for `num_points` simultaneous points.
  explicit PoseChain(int num_shared, int num_points = 0);

  /// Information of the next pose to be eliminated, the two after it, and the border (shared parameters, then three
  /// components for each point): callers add J^T J and J^T r of their factors. Only the lower half of symmetric blocks
  /// is used.
  Eigen::Matrix<double, window, window> A;
  Eigen::Matrix<double, window, Eigen::Dynamic> U;  ///< Window by border.
  Eigen::MatrixXd B;
  Eigen::Vector<double, window> a;
  Eigen::VectorXd b;
  /// B + weight · v vᵀ; deferred to the next elimination, in one pass with it.
  void add_square(const Eigen::VectorXd& v, double weight);

  /// Enters a point; returns its offset in the border. Points are numbered from zero, in any order.
  int enter(std::size_t point);
  /// Eliminates a point. False if its position is not determined.
  [[nodiscard]] bool leave(std::size_t point);
  [[nodiscard]] int place_of(std::size_t point) const { return place_of_[point]; }
  /// Eliminates the first pose of the window. False if it is not determined.
  [[nodiscard]] bool eliminate();

  /// Σ |L⁻¹ a|² of all eliminated ones: the decrease of the cost by their steps.
  [[nodiscard]] double gain() const;

  /// Steps of all poses and points, in order, for given shared parameters `shared`.
  struct Steps {
    std::vector<Eigen::Vector<double, pose_dim>> poses;
    std::vector<Eigen::Vector3d> points;
  };
  [[nodiscard]] Steps steps(const Eigen::VectorXd& shared) const;

  /// Covariance of each pose and point if that of the shared parameters is `shared_cov`, and the derivatives of each
  /// with respect to given numbers (`J_shared`: those of the shared parameters).
  struct Spread {
    std::vector<Eigen::Matrix<double, pose_dim, pose_dim>> cov;
    std::vector<Eigen::Matrix<double, pose_dim, Eigen::Dynamic>> J;
    std::vector<Eigen::Matrix3d> point_cov;
    std::vector<Eigen::Matrix<double, 3, Eigen::Dynamic>> point_J;
  };
  [[nodiscard]] Spread spread(const Eigen::MatrixXd& shared_cov, const Eigen::MatrixXd& J_shared) const;

  /// Σ W: covariance of all poses and points with weighted sums, W having six rows for each pose and three for each
  /// point (points empty: none); the first `num_solved` shared parameters are estimated, too, the others fixed.
  struct Columns {
    std::vector<Eigen::MatrixXd> poses, points;
  };
  [[nodiscard]] Columns solve(const Columns& W, int num_solved) const;

 private:
  static constexpr int rest_dim = window - pose_dim;
  enum class Event { entered, left, pose };
  /// An elimination, with the rows needed for back-substitution: x = L⁻ᵀ (y − W_poses … − W_border …).
  struct Step {
    Event event = Event::pose;
    std::size_t index = 0;
    int place = 0;
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, pose_dim, pose_dim> L;
    Eigen::Matrix<double, Eigen::Dynamic, rest_dim, 0, pose_dim, rest_dim> W_poses;
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic> W_border;  ///< For the part in use at the time.
    Eigen::Vector<double, Eigen::Dynamic> y;
  };
  struct Backward;
  void take_out(const Step& step);
  void take_from_border(const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic>& W);
  [[nodiscard]] std::vector<Eigen::MatrixXd> forward(const Columns& W, Eigen::MatrixXd& border) const;

  int num_shared_ = 0, num_used_ = 0;  ///< Columns of the border: shared, in use.
  std::size_t num_poses_ = 0;
  std::vector<int> place_of_;  ///< Of each point.
  std::vector<bool> is_taken_;
  std::vector<Step> steps_;
  Eigen::VectorXd square_;  ///< Pending add_square(),
  double square_weight_ = 0.0;
  std::vector<double> left_, right_;  ///< In panels: factors of the update of B.
};

}  // namespace alidade
