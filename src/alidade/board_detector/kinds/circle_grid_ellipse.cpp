#include "alidade/board_detector/kinds/circle_grid_ellipse.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>
#include <vector>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

using Vector8 = Eigen::Vector<double, 8>;
using Matrix8 = Eigen::Matrix<double, 8, 8>;

/// Parameters: centre (2), A (a, b, c of [a b; b c]), blur, outside, contrast.
struct Disc {
  Vector8 values;

  [[nodiscard]] Eigen::Vector2d centre() const { return values.head<2>(); }
  [[nodiscard]] Eigen::Matrix2d A() const {
    return (Eigen::Matrix2d() << values[2], values[3], values[3], values[4]).finished();
  }
  [[nodiscard]] bool is_disc() const {
    return values.allFinite() && values[2] > 0.0 && values[2] * values[4] > values[3] * values[3] && values[5] > 0.1;
  }
};

struct NormalSums {
  Matrix8 JtJ = Matrix8::Zero();
  Vector8 Jtr = Vector8::Zero();
  double cost = 0.0;
  int num_pixels = 0;
};

/// Residual (prediction − observation) and its derivatives at one pixel. Beside the edge the slope of the distance is
/// taken as that of √(rᵀAr) alone: it differs only where the edge's bell is small.
double residual_at(const Disc& disc, const Eigen::Matrix2d& A, const Eigen::Vector2d& r, double grey, Vector8& J) {
  const double q = std::sqrt(std::max(r.dot(A * r), 1e-12));
  const Eigen::Vector2d q_r = A * r / q;
  const double inverse_slope = 1.0 / std::max(q_r.norm(), 1e-9);
  const double blur = disc.values[5], distance = (q - 1.0) * inverse_slope;
  const double z = distance / blur;
  const double inside = 0.5 * std::erfc(z / std::numbers::sqrt2);
  const double bell = -disc.values[7] * std::exp(-0.5 * z * z) / (blur * std::sqrt(2.0 * std::numbers::pi));
  J.head<2>() = -bell * inverse_slope * q_r;
  J[2] = bell * inverse_slope * r.x() * r.x() / (2.0 * q);
  J[3] = bell * inverse_slope * r.x() * r.y() / q;
  J[4] = bell * inverse_slope * r.y() * r.y() / (2.0 * q);
  J[5] = -bell * z;
  J[6] = 1.0;
  J[7] = inside;
  return disc.values[6] + disc.values[7] * inside - grey;
}

/// The pixels that count: those within `reach` of the start, measured in its own ellipses, but not too far from its
/// edge.
struct Window {
  Eigen::Vector2d centre;
  Eigen::Matrix2d A;
  int u_min, u_max, v_min, v_max;
};

Window window_around(const cv::Mat& photo, const Ellipse& start) {
  constexpr double reach = 1.6;  // radii: the neighbour's edge is further away
  const Eigen::Matrix2d spread = start.A.inverse();
  const double du = reach * std::sqrt(spread(0, 0)), dv = reach * std::sqrt(spread(1, 1));
  return {start.px,
          start.A / (reach * reach),
          std::max(0, static_cast<int>(std::ceil(start.px.x() - du))),
          std::min(photo.cols - 1, static_cast<int>(std::floor(start.px.x() + du))),
          std::max(0, static_cast<int>(std::ceil(start.px.y() - dv))),
          std::min(photo.rows - 1, static_cast<int>(std::floor(start.px.y() + dv)))};
}

NormalSums normal_sums(const cv::Mat& photo, const Window& window, const Disc& disc) {
  NormalSums sums;
  const Eigen::Matrix2d A = disc.A();
  Vector8 J;
  for (int v = window.v_min; v <= window.v_max; ++v) {
    const float* row = photo.ptr<float>(v);
    for (int u = window.u_min; u <= window.u_max; ++u) {
      const Eigen::Vector2d from_window = Eigen::Vector2d(u, v) - window.centre;
      if (from_window.dot(window.A * from_window) > 1.0) continue;
      const double residual =
          residual_at(disc, A, Eigen::Vector2d(u, v) - disc.centre(), static_cast<double>(row[u]), J);
      sums.JtJ.selfadjointView<Eigen::Lower>().rankUpdate(J);
      sums.Jtr += residual * J;
      sums.cost += residual * residual;
      ++sums.num_pixels;
    }
  }
  sums.JtJ.triangularView<Eigen::StrictlyUpper>() = sums.JtJ.transpose();
  return sums;
}

/// Grey values inside and outside the start's edge, for a first contrast.
Disc first_disc(const cv::Mat& photo, const Window& window, const Ellipse& start) {
  double sums[2] = {0.0, 0.0};
  int counts[2] = {0, 0};
  for (int v = window.v_min; v <= window.v_max; ++v) {
    for (int u = window.u_min; u <= window.u_max; ++u) {
      const Eigen::Vector2d r = Eigen::Vector2d(u, v) - start.px;
      const double q = r.dot(start.A * r);
      if (q > 2.5) continue;
      const int side = q > 1.0;
      sums[side] += static_cast<double>(photo.at<float>(v, u));
      ++counts[side];
    }
  }
  const double inside = sums[0] / std::max(counts[0], 1), outside = sums[1] / std::max(counts[1], 1);
  Disc disc;
  disc.values << start.px, start.A(0, 0), start.A(0, 1), start.A(1, 1), 1.0, outside, inside - outside;
  return disc;
}

}  // namespace

double Ellipse::area() const { return std::numbers::pi / std::sqrt(A.determinant()); }

std::optional<Ellipse> fit_ellipse(const cv::Mat& photo, const Ellipse& start) {
  const Window window = window_around(photo, start);
  Disc disc = first_disc(photo, window, start);
  NormalSums sums = normal_sums(photo, window, disc);
  constexpr int max_iterations = 25, min_pixels = 30;
  double damping = 1e-3;
  bool converged = false;
  for (int i = 0; i < max_iterations && !converged && damping < 1e6; ++i) {
    Matrix8 damped = sums.JtJ;
    damped.diagonal() *= 1.0 + damping;
    const Vector8 step = -damped.ldlt().solve(sums.Jtr);
    const Disc next{disc.values + step};
    converged = step.head<2>().norm() < 1e-4;
    const NormalSums next_sums = next.is_disc() ? normal_sums(photo, window, next) : NormalSums{.cost = HUGE_VAL};
    const bool is_better = next_sums.cost < sums.cost;
    if (is_better) {
      disc = next;
      sums = next_sums;
    }
    damping *= is_better ? 0.1 : 10.0;
  }
  if (!converged || sums.num_pixels < min_pixels) return std::nullopt;
  const double variance = sums.cost / (sums.num_pixels - 8);
  Ellipse ellipse{disc.centre(), disc.A(), Eigen::Matrix2d::Zero(), disc.values[7]};
  ellipse.cov = variance * Matrix8(sums.JtJ.ldlt().solve(Matrix8::Identity())).topLeftCorner<2, 2>();
  constexpr double max_misfit = 0.15;  // of the contrast: something else, or half hidden
  const bool is_plain = std::sqrt(variance) < max_misfit * std::abs(ellipse.contrast);
  const bool stayed = (ellipse.px - start.px).dot(start.A * (ellipse.px - start.px)) < 0.25;
  return is_plain && stayed && ellipse.cov.allFinite() ? std::optional(ellipse) : std::nullopt;
}

std::optional<Ellipse> ellipse_through(std::span<const Eigen::Vector2d> points) {
  if (points.size() < 5) return std::nullopt;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& point : points) mean += point / static_cast<double>(points.size());
  double scale = 0.0;
  for (const Eigen::Vector2d& point : points) scale = std::max(scale, (point - mean).norm());
  // a x² + 2b xy + c y² + 2d x + 2e y = 1 around the mean, which lies inside
  Eigen::MatrixXd rows(static_cast<Eigen::Index>(points.size()), 5);
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    const Eigen::Vector2d p = (points[static_cast<std::size_t>(i)] - mean) / scale;
    rows.row(i) << p.x() * p.x(), 2.0 * p.x() * p.y(), p.y() * p.y(), 2.0 * p.x(), 2.0 * p.y();
  }
  const Eigen::VectorXd conic = least_squares(rows, Eigen::VectorXd::Ones(rows.rows()));
  const Eigen::Matrix2d Q = (Eigen::Matrix2d() << conic[0], conic[1], conic[1], conic[2]).finished();
  if (!(Q(0, 0) > 0.0 && Q.determinant() > 0.0)) return std::nullopt;
  const Eigen::Vector2d linear = conic.tail<2>();
  const Eigen::Vector2d centre = -Q.inverse() * linear;
  Ellipse ellipse;
  ellipse.px = mean + scale * centre;
  ellipse.A = Q / ((1.0 + centre.dot(Q * centre)) * scale * scale);
  return ellipse;
}

}  // namespace alidade
