#include <Eigen/Cholesky>
#include <algorithm>

#include "alidade/estimation/iterated_update.h"
#include "alidade/localize/filter/filter.h"

// One-point consensus (J. Civera et al., "1-Point RANSAC for EKF Filtering", J. Field Robotics 27(5), 2010) in the
// space of innovations: with the joint covariance S of all innovations, one of them, assumed an inlier, predicts every
// other: ν_i − S_ij S_jj⁻¹ ν_j with covariance S_ii − S_ij S_jj⁻¹ S_ji. No state is updated, and all are tried in turn.

namespace alidade {
namespace {

constexpr std::size_t max_for_snooping = 40;  // S is inverted as a whole
constexpr int max_dropped = 6;                // the gates of the update reject the remaining ones

}  // namespace

void LocalizationFilter::fill_joint_innovations() {
  const std::size_t num = waiting_.size();
  if (joint_x_.size() == 0) {  // allocated only when mismatches occur
    joint_x_.resize(P_.capacity(), 2 * config_.observations_capacity);
    joint_s_.resize(2 * config_.observations_capacity, 2 * config_.observations_capacity);
    joint_nu_.resize(2 * config_.observations_capacity);
  }
  for (std::size_t b = 0; b < num; ++b) {
    const auto at = static_cast<Eigen::Index>(2 * b);
    P_.product(waiting_[b]->rows(), joint_x_.col(at).data(), joint_x_.col(at + 1).data());
    joint_nu_.segment<2>(at) = waiting_[b]->nu;
    for (std::size_t a = 0; a <= b; ++a) {
      const Measured& measured = *waiting_[a];
      Eigen::Matrix2d S = Eigen::Matrix2d::Zero();
      for (std::size_t c = 0; c < static_cast<std::size_t>(measured.num_support); ++c) {
        const double x0 = joint_x_(measured.columns[c], at), x1 = joint_x_(measured.columns[c], at + 1);
        S(0, 0) += measured.h0[c] * x0;
        S(0, 1) += measured.h0[c] * x1;
        S(1, 0) += measured.h1[c] * x0;
        S(1, 1) += measured.h1[c] * x1;
      }
      if (a == b) S.diagonal().array() += measured.variance_px2;
      joint_s_.block<2, 2>(static_cast<Eigen::Index>(2 * a), at) = S;
      joint_s_.block<2, 2>(at, static_cast<Eigen::Index>(2 * a)) = S.transpose();
    }
  }
}

/// Cost if `chosen` is an inlier: the sum of all NIS, each capped at the gate. Inliers are marked in `agrees_`.
double LocalizationFilter::agreement_with(std::size_t chosen) {
  const auto j = static_cast<Eigen::Index>(2 * chosen);
  const Eigen::Matrix2d S_jj = joint_s_.block<2, 2>(j, j);
  const Eigen::Matrix2d S_jj_inverse = inverse_of_symmetric(S_jj);
  const Eigen::Vector2d nu_j = joint_nu_.segment<2>(j), weighted = S_jj_inverse * nu_j;
  double cost = std::min(nu_j.dot(weighted), config_.gate);
  for (std::size_t k = 0; k < waiting_.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(2 * k);
    const Eigen::Matrix2d S_ij = joint_s_.block<2, 2>(i, j), S_ii = joint_s_.block<2, 2>(i, i);
    const Eigen::Vector2d nu = joint_nu_.segment<2>(i) - S_ij * weighted;
    const Eigen::Matrix2d S = S_ii - S_ij * S_jj_inverse * S_ij.transpose();
    const double nis = nu.dot(inverse_of_symmetric(S) * nu);
    const bool agrees = k == chosen || nis <= config_.gate;
    agrees_[k] = agrees ? 1 : 0;
    if (k != chosen) cost += agrees ? nis : config_.gate;
  }
  return cost;
}

/// Data snooping: each of the agreeing observations against the prediction from all others: νᵢ given the rest has
/// information (S⁻¹)ᵢᵢ and weighted innovation (S⁻¹ν)ᵢ. The worst one beyond the gate is removed, repeatedly.
/// W. Baarda, "A Testing Procedure for Use in Geodetic Networks", 1968.
void LocalizationFilter::drop_doubtful() {
  for (int dropped = 0; dropped < max_dropped && waiting_.size() > 3; ++dropped) {
    if (waiting_.size() > max_for_snooping) return;
    fill_joint_innovations();
    const auto num = static_cast<Eigen::Index>(2 * waiting_.size());
    auto S = joint_s_.topLeftCorner(num, num);
    auto inverse = joint_x_.topLeftCorner(num, num);  // its content is no longer needed
    if (joint_x_.rows() < num) return;
    Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(S);
    if (llt.info() != Eigen::Success) return;
    inverse.setIdentity();
    llt.solveInPlace(inverse);
    std::size_t worst = 0;
    double worst_nis = 0.0;
    for (std::size_t k = 0; k < waiting_.size(); ++k) {
      const auto i = static_cast<Eigen::Index>(2 * k);
      const Eigen::Vector2d weighted = inverse.middleRows<2>(i) * joint_nu_.head(num);
      const Eigen::Matrix2d information = inverse.block<2, 2>(i, i);
      const double nis = weighted.dot(inverse_of_symmetric(information) * weighted);
      if (nis > worst_nis) {
        worst_nis = nis;
        worst = k;
      }
    }
    if (!(worst_nis > config_.gate)) return;
    doubtful_.push_back(waiting_[worst]);
    waiting_.erase(waiting_.begin() + static_cast<std::ptrdiff_t>(worst));
  }
}

void LocalizationFilter::keep_consensus() {
  fill_joint_innovations();
  double best = std::numeric_limits<double>::infinity();
  agrees_.assign(waiting_.size(), 0);
  agrees_best_.clear();
  for (std::size_t k = 0; k < waiting_.size(); ++k) {
    const double cost = agreement_with(k);
    if (!(cost < best)) continue;
    best = cost;
    agrees_best_ = agrees_;
  }
  if (agrees_best_.size() != waiting_.size()) return;  // no finite cost
  std::size_t kept = 0;
  for (std::size_t k = 0; k < waiting_.size(); ++k) {
    if (agrees_best_[k])
      waiting_[kept++] = waiting_[k];
    else
      doubtful_.push_back(waiting_[k]);
  }
  waiting_.resize(kept);
  drop_doubtful();
}

}  // namespace alidade
