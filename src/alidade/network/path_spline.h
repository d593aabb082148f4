#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <vector>

namespace alidade {

/// A path in space over time: uniform cubic B-spline.
struct PathSpline {
  double from_s = 0.0, knot_s = 1.0;
  std::vector<Eigen::Vector3d> control;

  /// The four control points that a time depends on, their weights, and the weights' time derivatives.
  struct Support {
    std::size_t first = 0;
    std::array<double, 4> weight{}, rate{};
  };
  /// None outside of the spline.
  [[nodiscard]] std::optional<Support> support(double t_s) const;
  [[nodiscard]] Eigen::Vector3d position(const Support& at) const;
  [[nodiscard]] Eigen::Vector3d velocity(const Support& at) const;
};

/// Least squares in a path's control points (each coupled to its neighbours only) and few shared parameters:
///     [ A  Wᵀ' ] [δ path  ]   [a]
///     [ W   U  ] [δ common] = [c]
/// A is banded and is eliminated by Cholesky; the rest is the information of the shared parameters.
class PathSystem {
 public:
  static constexpr int band = 12;  ///< Of the lower triangle, with the diagonal: four control points in 3-D.
  PathSystem(std::size_t num_control, Eigen::Index num_common);

  /// Adds a residual r (already weighted) with its derivatives by four control points and by the shared parameters.
  void add(std::size_t first_control, const Eigen::Matrix<double, 2, 12>& J_path, const Eigen::Vector2d& r,
           Eigen::Index first_common, const Eigen::MatrixXd& J_common);
  /// Adds (C[k−1] − 2 C[k] + C[k+1]) · weight as a residual: prior of the path's acceleration.
  void add_bend(std::span<const Eigen::Vector3d> control, std::size_t k, double weight);
  void add_common(const Eigen::VectorXd& J_common, double r);

  [[nodiscard]] Eigen::Index num_common() const { return common_.size(); }

  struct Step {
    Eigen::VectorXd path, common;
  };
  /// The step at this damping (Levenberg–Marquardt: diagonals times 1 + damping). None if singular.
  [[nodiscard]] std::optional<Step> solve(double damping);
  /// After solve(0): information of the shared parameters, and A⁻¹Wᵀ for scores.
  [[nodiscard]] const Eigen::MatrixXd& information() const { return information_; }
  [[nodiscard]] Eigen::MatrixXd path_by_common() const;

 private:
  [[nodiscard]] bool factor(double damping);

  Eigen::Matrix<double, Eigen::Dynamic, band, Eigen::RowMajor> A_, L_;  ///< Column d: the d-th below the diagonal.
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> W_, Y_;  ///< Path × shared parameters.
  Eigen::MatrixXd U_, information_;
  Eigen::VectorXd path_, common_;
};

}  // namespace alidade
