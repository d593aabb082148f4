#include "alidade/calibrate/solve/weights.h"
#include "alidade/estimation/median.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

namespace alidade {
namespace {

const Eigen::Matrix2d no_cov = Eigen::Matrix2d::Zero();

const Eigen::Matrix2d& own_cov(const Corner& corner, bool use_covariances) {
  return use_covariances ? corner.cov : no_cov;
}

constexpr double min_variance = 1e-12;  // px²: noise-free corners still have a finite weight

/// (own + excess² I)⁻¹ r.
Eigen::Vector2d weighted(const Eigen::Vector2d& r, const Eigen::Matrix2d& own, double excess2) {
  const double p = own(0, 0) + excess2 + min_variance, q = own(0, 1), s = own(1, 1) + excess2 + min_variance;
  const double inverse = 1.0 / (p * s - q * q);
  return {inverse * (s * r.x() - q * r.y()), inverse * (p * r.y() - q * r.x())};
}

/// rᵀ Σ⁻¹ r with Σ = own + excess² I.
double mahalanobis2(const Eigen::Vector2d& r, const Eigen::Matrix2d& own, double excess2) {
  return r.dot(weighted(r, own, excess2));
}

double median_norm(const std::vector<std::vector<Eigen::Vector2d>>& residuals) {
  std::vector<double> norms;
  for (const auto& view : residuals) {
    for (const auto& r : view) {
      if (r.allFinite()) norms.push_back(r.norm());
    }
  }
  return median_of(std::move(norms));
}

/// Visits every corner as (view, corner number, residual, own covariance).
template <class Visit>
void for_each_corner(std::span<const BoardView> views, const std::vector<std::vector<Eigen::Vector2d>>& residuals,
                     bool use_covariances, Visit&& visit) {
  for (std::size_t k = 0; k < views.size(); ++k) {
    for (std::size_t i = 0; i < residuals[k].size(); ++i) {
      visit(k, i, residuals[k][i], own_cov(views[k].corners[i], use_covariances));
    }
  }
}

/// The excess² [px²] for which χ² equals its degrees of freedom; 0 where the own covariances explain more than there
/// is. Newton on dof/χ² − 1, which is linear in the excess where corners bring no covariance.
double matching_excess2(std::span<const BoardView> views, const std::vector<std::vector<Eigen::Vector2d>>& residuals,
                        bool use_covariances, const std::vector<std::vector<bool>>& used, int num_parameters) {
  double total = 0.0, count = 0.0;
  for_each_corner(views, residuals, use_covariances, [&](std::size_t k, std::size_t i, const auto& r, const auto&) {
    if (!used[k][i]) return;
    total += r.squaredNorm();
    count += 1.0;
  });
  const double dof = std::max(1.0, 2.0 * count - num_parameters);
  double excess2 = total / dof;
  if (!use_covariances) return excess2;
  for (int iteration = 0; iteration < 12; ++iteration) {
    double chi2 = 0.0, slope = 0.0;
    for_each_corner(views, residuals, true, [&](std::size_t k, std::size_t i, const auto& r, const auto& own) {
      if (!used[k][i]) return;
      const Eigen::Vector2d w = weighted(r, own, excess2);
      chi2 += r.dot(w);
      slope -= w.squaredNorm();
    });
    const double step = (chi2 - dof) * chi2 / (dof * slope);
    const double next = std::max(0.0, excess2 - step);
    const bool done = std::abs(next - excess2) <= 1e-6 * (excess2 + 1e-12);
    excess2 = next;
    if (done) break;
  }
  return excess2;
}

}  // namespace

bool have_covariances(std::span<const BoardView> views) {
  for (const BoardView& view : views) {
    for (const Corner& corner : view.corners) {
      if (corner.cov != Eigen::Matrix2d::Identity()) return true;
    }
  }
  return false;
}

NoiseEstimate estimate_noise(std::span<const BoardView> views,
                             const std::vector<std::vector<Eigen::Vector2d>>& residuals, bool use_covariances,
                             bool reject, double outlier_sigmas, int num_parameters) {
  NoiseEstimate noise;
  const double robust_sigma = median_norm(residuals) / rayleigh_median;
  noise.excess_px = robust_sigma;
  for (const auto& view : residuals) noise.used.emplace_back(view.size(), true);

  const double most2 = outlier_sigmas * outlier_sigmas, near2 = most2 * robust_sigma * robust_sigma;
  constexpr int max_rounds = 4;
  for (int round = 0; round < max_rounds; ++round) {
    // The first scale is robust; never let it fall below a tenth of that, or a good fit would disown its own corners.
    const double floor2 =
        round == 0 ? noise.excess_px * noise.excess_px
                   : std::max(noise.excess_px, 0.1 * robust_sigma) * std::max(noise.excess_px, 0.1 * robust_sigma);
    std::size_t dropped = 0, changed = 0;
    for_each_corner(
        views, residuals, use_covariances, [&](std::size_t k, std::size_t i, const auto& r, const auto& own) {
          const bool is_near = r.squaredNorm() <= near2;
          const bool fits = is_near || (r.allFinite() && (!reject || mahalanobis2(r, own, floor2) <= most2));
          if (noise.used[k][i] != fits) ++changed;
          noise.used[k][i] = fits;
          dropped += fits ? 0 : 1;
        });
    noise.num_dropped = dropped;
    if (round > 0 && changed == 0) break;  // the same corners, the same excess

    const double before = noise.excess_px;
    noise.excess_px = std::sqrt(matching_excess2(views, residuals, use_covariances, noise.used, num_parameters));
    if (std::abs(noise.excess_px - before) <= 1e-3 * before) break;
  }
  return noise;
}

void set_whiteners(const BoardView& view, const std::vector<Eigen::Vector2d>& residuals, const NoiseEstimate& noise,
                   const std::vector<bool>& used, bool use_covariances, double huber_sigmas, ViewArrays& arrays) {
  const double excess2 = noise.excess_px * noise.excess_px;
  for (std::size_t i = 0; i < view.corners.size(); ++i) {
    const Eigen::Matrix2d& own = own_cov(view.corners[i], use_covariances);
    double weight = used[i] ? 1.0 : 0.0;
    if (huber_sigmas > 0.0) {
      const double distance = residuals[i].allFinite() ? std::sqrt(mahalanobis2(residuals[i], own, excess2)) : 1e9;
      weight = distance > huber_sigmas ? huber_sigmas / distance : 1.0;
    }
    set_whitener(arrays, i, own + (excess2 + min_variance) * Eigen::Matrix2d::Identity(), weight);
  }
}

}  // namespace alidade
