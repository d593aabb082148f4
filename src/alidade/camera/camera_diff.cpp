#include "alidade/camera/camera_diff.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "alidade/camera/implied_motion.h"
#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

using detail::GridPoint;
using Seen = std::vector<std::optional<GridPoint>>;

bool has_covariance(const Camera& camera) {
  return camera.cov.rows() == params(camera.lens).size() && camera.cov.cols() == camera.cov.rows();
}

/// What b sees of a's points, moved into b's frame; none where a or b does not see.
Seen look_with(const Camera& b, const Rigid3& b_from_a, const Seen& seen_by_a) {
  std::vector<Eigen::Vector3d> points_in_b;
  for (const auto& at : seen_by_a) {
    const Eigen::Vector3d point_in_a = at ? at->point_in_cam : Eigen::Vector3d::Constant(nan);
    points_in_b.push_back(b_from_a * point_in_a);
  }
  const std::vector<std::optional<LensProjection>> projections = project_with_jacobians(b, points_in_b);
  Seen seen(seen_by_a.size());
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (projections[i]) seen[i] = GridPoint{points_in_b[i], *projections[i]};
  }
  return seen;
}

/// Weights of one iteration: 1/s², with s the pixel's σ (1 where none is known), times (t/e)² where e = |δ|/s is beyond
/// the threshold t of twice the median; never below 3σ where σ is known, so that noise alone is not down-weighted.
std::vector<double> robust_weights(const Seen& seen, const std::vector<Eigen::Vector2d>& pixels,
                                   const std::vector<double>& base_weights, bool has_sigma) {
  std::vector<double> sizes(seen.size(), 0.0), of_seen;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (!seen[i]) continue;
    sizes[i] = (seen[i]->projection.px - pixels[i]).norm() * std::sqrt(base_weights[i]);
    of_seen.push_back(sizes[i]);
  }
  const double threshold = std::max(2.0 * median_of(of_seen), has_sigma ? 3.0 : 1e-12);
  std::vector<double> weights = base_weights;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (sizes[i] > threshold) weights[i] *= std::pow(threshold / sizes[i], 2);
  }
  return weights;
}

/// The Gauss–Newton step of the motion: x → exp(φ) x + range·τ in b's frame.
Rigid3 motion_step(const Seen& seen, const std::vector<Eigen::Vector2d>& pixels, const std::vector<double>& weights,
                   double range_m) {
  const Eigen::Index num_motion = range_m > 0.0 ? 6 : 3;
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(num_motion, num_motion);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(num_motion);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (!seen[i]) continue;
    const detail::MotionJacobian J = detail::motion_jacobian(*seen[i], range_m);
    H.noalias() += weights[i] * J.transpose() * J;
    g.noalias() += weights[i] * J.transpose() * (seen[i]->projection.px - pixels[i]);
  }
  const Eigen::VectorXd step = -minimum_norm_solution(H, g);
  Rigid3 b_from_b{exp_so3(step.tail<3>()), Eigen::Vector3d::Zero()};
  if (range_m > 0.0) b_from_b.translation = range_m * step.head<3>();
  return b_from_b;
}

/// The motion that fits best, with what b sees then and the weights that it was fitted with.
struct Fit {
  Rigid3 b_from_a;
  Seen seen;
  std::vector<double> weights;
};

Fit fit_motion(const Camera& b, const Seen& seen_by_a, const std::vector<Eigen::Vector2d>& pixels,
               const std::vector<double>& base_weights, bool has_sigma, double range_m) {
  constexpr int max_iterations = 30;  // Newton's part takes 3–5; the robust weights settle in some more
  Fit fit;
  for (int i = 0; i < max_iterations; ++i) {
    fit.seen = look_with(b, fit.b_from_a, seen_by_a);
    fit.weights = robust_weights(fit.seen, pixels, base_weights, has_sigma);
    const Rigid3 step = motion_step(fit.seen, pixels, fit.weights, range_m);
    fit.b_from_a = step * fit.b_from_a;
    if (log_so3(step.rotation).norm() + step.translation.norm() / std::max(range_m, 1e-12) < 1e-12) break;
  }
  fit.seen = look_with(b, fit.b_from_a, seen_by_a);
  return fit;
}

/// sqrt(δᵀ C⁻¹ δ / 2) with C the sum of what is known.
std::vector<double> differences_in_sigmas(const Camera& a, const Camera& b, const Seen& seen_by_a, const Fit& fit,
                                          const std::vector<Eigen::Vector2d>& pixels, double range_m) {
  std::vector<Eigen::Matrix2d> C(pixels.size(), Eigen::Matrix2d::Zero());
  const auto add = [&](const Camera& camera, const Seen& seen) {
    if (!has_covariance(camera)) return;
    const auto own = detail::implied_covariance(camera.cov, seen, fit.weights, range_m);
    for (std::size_t i = 0; i < C.size(); ++i) C[i] += own[i];
  };
  add(a, seen_by_a);
  add(b, fit.seen);
  std::vector<double> in_sigmas(pixels.size(), nan);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if (!fit.seen[i] || !(C[i].determinant() > 0.0)) continue;
    const Eigen::Vector2d delta = fit.seen[i]->projection.px - pixels[i];
    in_sigmas[i] = std::sqrt(0.5 * delta.dot(C[i].inverse() * delta));
  }
  return in_sigmas;
}

std::vector<ParameterDiff> parameter_table(const Camera& a, const Camera& b) {
  if (a.lens.index() != b.lens.index()) return {};
  const std::vector<std::string> names = param_names(a.lens);
  const Eigen::VectorXd of_a = params(a.lens), of_b = params(b.lens);
  const auto sigma = [](const Camera& camera, Eigen::Index i) {
    return has_covariance(camera) ? std::sqrt(std::max(0.0, camera.cov(i, i))) : nan;
  };
  std::vector<ParameterDiff> table;
  for (Eigen::Index i = 0; i < of_a.size(); ++i) {
    table.push_back({names[static_cast<std::size_t>(i)], of_a[i], of_b[i], sigma(a, i), sigma(b, i)});
  }
  return table;
}

/// Root mean square and maximum of what is a number.
struct Summary {
  double rms = nan, max = nan;
};

Summary summarize(const std::vector<double>& values) {
  double sum = 0.0, max = 0.0;
  std::size_t count = 0;
  for (const double value : values) {
    if (std::isnan(value)) continue;
    sum += value * value;
    max = std::max(max, std::abs(value));
    ++count;
  }
  if (count == 0) return {};
  return {std::sqrt(sum / static_cast<double>(count)), max};
}

/// Fills in the differences of the pixels and their summaries.
void set_differences(CameraDiff& diff, const Fit& fit, const std::vector<Eigen::Vector2d>& pixels, const Camera& a) {
  const Eigen::Vector2d centre_px(0.5 * (a.width_px - 1), 0.5 * (a.height_px - 1));
  const double central_radius_px = std::min(a.width_px, a.height_px) / 6.0;
  std::vector<double> sizes, central;
  diff.delta_u.values.assign(pixels.size(), nan);
  diff.delta_v.values.assign(pixels.size(), nan);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if (!fit.seen[i]) continue;
    const Eigen::Vector2d delta = fit.seen[i]->projection.px - pixels[i];
    diff.delta_u.values[i] = delta.x();
    diff.delta_v.values[i] = delta.y();
    sizes.push_back(delta.norm());
    if ((pixels[i] - centre_px).norm() < central_radius_px) central.push_back(delta.norm());
  }
  diff.num_compared = sizes.size();
  diff.rms_px = summarize(sizes).rms;
  diff.max_px = summarize(sizes).max;
  diff.central_rms_px = summarize(central).rms;
}

/// 1/σ² of the difference by what is known of a and b.
std::vector<double> variance_weights(const CameraDiff& diff) {
  std::vector<double> sigmas_px(diff.sigma_a.values.size(), 0.0);
  for (std::size_t i = 0; i < sigmas_px.size(); ++i) {
    for (const double sigma_px : {diff.sigma_a.values[i], diff.sigma_b.values[i]}) {
      if (!std::isnan(sigma_px)) sigmas_px[i] = std::hypot(sigmas_px[i], sigma_px);
    }
  }
  return detail::inverse_variance_weights(sigmas_px);
}

}  // namespace

std::optional<CameraDiff> diff_cameras(const Camera& a, const Camera& b, const CameraDiffConfig& config) {
  if (a.width_px != b.width_px || a.height_px != b.height_px || a.width_px < 1 || a.height_px < 1) return std::nullopt;
  const bool has_sigma = has_covariance(a) || has_covariance(b);
  const double range_m = std::isfinite(config.distance_m) ? config.distance_m : 0.0;
  CameraDiff diff;
  const PixelGrid grid = make_grid(a.width_px, a.height_px, config.cols, config.rows);
  diff.delta_u = diff.delta_v = diff.in_sigmas = grid;
  diff.sigma_a = projection_sigma(a, config.cols, config.rows, config.distance_m);
  diff.sigma_b = projection_sigma(b, config.cols, config.rows, config.distance_m);

  std::vector<Eigen::Vector2d> pixels;
  for (int row = 0; row < grid.rows; ++row) {
    for (int col = 0; col < grid.cols; ++col) pixels.push_back(grid.px(col, row));
  }
  // Infinity is far enough for a lens that is not central (see look()).
  Seen seen_by_a = detail::look(a, grid, is_central(b.lens) ? config.distance_m : std::min(config.distance_m, 1e6));
  const Fit fit = fit_motion(b, seen_by_a, pixels, variance_weights(diff), has_sigma, range_m);
  set_differences(diff, fit, pixels, a);
  if (diff.num_compared < 10) return std::nullopt;
  for (std::size_t i = 0; i < seen_by_a.size(); ++i) {
    if (!fit.seen[i]) seen_by_a[i].reset();  // both sides of the comparison over the same pixels
  }
  diff.b_from_a = fit.b_from_a;
  diff.in_sigmas.values = differences_in_sigmas(a, b, seen_by_a, fit, pixels, range_m);
  diff.rms_in_sigmas = summarize(diff.in_sigmas.values).rms;
  diff.max_in_sigmas = summarize(diff.in_sigmas.values).max;
  diff.parameters = parameter_table(a, b);
  return diff;
}

}  // namespace alidade
