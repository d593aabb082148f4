#include "alidade/study/sigma_map_trials.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/so3.h"

namespace alidade {
namespace {

constexpr int cols = 21, rows = 16, step = 5;  // every fifth, from corner to corner: 5 × 4 of them
constexpr double far_away = std::numeric_limits<double>::infinity();

}  // namespace

SigmaMapTrials::SigmaMapTrials(Camera truth, const std::vector<int>& free, const Eigen::MatrixXd& bound)
    : grid_(make_grid(truth.width_px, truth.height_px, cols, rows)), seen_(detail::look(truth, grid_, far_away)) {
  const Eigen::Index size = params(truth.lens).size();
  truth.cov = Eigen::MatrixXd::Zero(size, size);
  for (std::size_t i = 0; i < free.size(); ++i)
    for (std::size_t j = 0; j < free.size(); ++j)
      truth.cov(free[i], free[j]) = bound(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
  std::vector<double> sigmas;
  for (const auto& cov : detail::implied_covariance(truth.cov, seen_, std::vector<double>(seen_.size(), 1.0), 0.0))
    sigmas.push_back(detail::largest_sigma(cov));
  weights_ = detail::inverse_variance_weights(sigmas);
  for (const auto& cov : detail::implied_covariance(truth.cov, seen_, weights_, 0.0)) {
    axes_.emplace_back(symmetric_eigen(cov).vectors.col(1));
    bounds_px_.push_back(detail::largest_sigma(cov));
  }
}

std::vector<TrialQuantity> SigmaMapTrials::quantities() {
  std::vector<TrialQuantity> all;
  for (int row = 0; row < rows; row += step)
    for (int col = 0; col < cols; col += step) all.push_back({fmt::format("map_{}_{}", col / step, row / step), "px"});
  return all;
}

std::vector<Eigen::Vector2d> SigmaMapTrials::errors_of(const Camera& found) const {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  std::vector<Eigen::Vector2d> errors(seen_.size(), Eigen::Vector2d::Zero());
  constexpr int iterations = 4;  // small rotations: the third changes nothing
  for (int iteration = 0; iteration < iterations; ++iteration) {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < errors.size(); ++i) {
      if (!seen_[i]) continue;
      const auto px = project(found, rotation * seen_[i]->point_in_cam);
      if (!px) continue;
      errors[i] = *px - seen_[i]->projection.px;
      const auto J = detail::motion_jacobian(*seen_[i], 0.0);
      H += weights_[i] * J.transpose() * J;
      g += weights_[i] * J.transpose() * errors[i];
    }
    if (iteration + 1 < iterations) rotation = exp_so3(-H.ldlt().solve(g)) * rotation;
  }
  return errors;
}

void SigmaMapTrials::add(const Camera& found, std::vector<TrialValue>& values) const {
  const auto sigmas = projection_sigma(found, cols, rows, far_away).values;
  const auto errors = errors_of(found);
  for (int row = 0; row < rows; row += step) {
    for (int col = 0; col < cols; col += step) {
      const auto i = static_cast<std::size_t>(row * cols + col);
      const double sigma = seen_[i] && std::isfinite(sigmas[i]) ? sigmas[i] : std::numeric_limits<double>::quiet_NaN();
      values.push_back({axes_[i].dot(errors[i]), sigma, bounds_px_[i]});
    }
  }
}

}  // namespace alidade
