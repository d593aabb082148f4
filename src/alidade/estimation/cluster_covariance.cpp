#include "alidade/estimation/cluster_covariance.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

namespace alidade {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using SymmetricSolver = Eigen::SelfAdjointEigenSolver<MatrixXd>;

/// A B. A product of small matrices is done before a blocked one has packed them.
template <typename A, typename B>
MatrixXd product(const A& a, const B& b) {
  constexpr Eigen::Index small = 16;
  if (a.cols() <= small && a.rows() <= small) return a.lazyProduct(b);
  return a * b;
}

/// Least rest 1 − h along a direction. A cluster that alone determines it has no residual in it: 0/0 is left at 0.
constexpr double min_rest = 1e-3;

/// A cluster where the model's covariance is 1. Its measurements of the requested parameters, made orthonormal,
/// contribute y: by the model of covariance 1 − m, m their leverage. `along` holds what a unit of each principal y
/// moves, `rest` 1 − m along it, `y` its value over √rest: by the model of variance 1.
struct Principal {
  MatrixXd along;
  VectorXd y, rest;
};

/// x: the score, by the model of mean 0 and covariance `share`.
struct Member {
  MatrixXd share;  ///< Empty where all members have the same, of the unit matrix.
  double trace;    ///< Of the share.
  VectorXd x;
  VectorXd contradiction = {};  ///< The part of x along directions in which it contradicts the others; empty: none.
  std::optional<Principal> principal;  ///< Where the leverage is large.
};

/// With share = C Cᵀ: y = C⁻¹ step, m = C⁻¹ taken C⁻ᵀ.
Principal principal_of(const MatrixXd& share, const MatrixXd* taken, const VectorXd& step) {
  const SymmetricSolver own(0.5 * (share + share.transpose()));
  const VectorXd size = own.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  const VectorXd inverse = size.unaryExpr([](double s) { return s > 1e-6 ? 1.0 / s : 0.0; });
  Principal principal{own.eigenvectors() * size.asDiagonal(),
                      inverse.cwiseProduct(own.eigenvectors().transpose() * step), own.eigenvalues()};
  if (taken != nullptr) {
    const MatrixXd to_y = inverse.asDiagonal() * own.eigenvectors().transpose();
    const SymmetricSolver leverage(to_y * *taken * to_y.transpose());
    principal.along *= leverage.eigenvectors();
    principal.y = leverage.eigenvectors().transpose() * principal.y;
    principal.rest = leverage.eigenvalues();
  }
  principal.rest = (1.0 - principal.rest.array()).max(min_rest);
  principal.y.array() /= principal.rest.array().sqrt();
  return principal;
}

/// (1 − m)^(−1/2) x, by its series to the third power: right to 5e-4 where the norm of m is below 0.2.
class SmallLeverage {
 public:
  void raise(const MatrixXd& m, VectorXd& x) {
    once_.noalias() = m * x;
    twice_.noalias() = m * once_;
    thrice_.noalias() = m * twice_;
    x += 0.5 * once_ + 0.375 * twice_ + 0.3125 * thrice_;
  }

 private:
  VectorXd once_, twice_, thrice_;  // kept from cluster to cluster
};

/// `cluster` is whitened; `equal_share` is that of one that brings none.
Member member_of(ClusterStep&& cluster, double noise_variance, double equal_share, SmallLeverage& small_leverage) {
  Member member{.share = std::move(cluster.spread), .trace = 0.0, .x = std::move(cluster.step)};
  member.x /= std::sqrt(noise_variance);
  if (member.share.size() == 0) {
    member.trace = equal_share * static_cast<double>(member.x.size());
    member.x /= std::sqrt(1.0 - equal_share);
    return member;
  }
  member.trace = member.share.trace();
  const bool has_taken = cluster.taken.size() > 0;
  MatrixXd leverage;
  if (has_taken) leverage = member.share.ldlt().solve(cluster.taken).transpose();
  const MatrixXd& m = has_taken ? leverage : member.share;
  constexpr double small = 0.2;  // of a norm, a bound of the leverage
  if (m.squaredNorm() < small * small) {
    small_leverage.raise(m, member.x);
    return member;
  }
  member.principal = principal_of(member.share, has_taken ? &cluster.taken : nullptr, member.x);
  member.x = member.principal->along * member.principal->y;
  return member;
}

/// Along directions in which a cluster contradicts the others, beyond chance and in units of their design effect, its
/// score becomes what its deletion changes: (1 − m)⁻¹ instead of (1 − m)^(−1/2). Beyond chance: none of all directions
/// of all clusters would by 19 chances in 20, were errors normal; P(|y| > t) < exp(−t²/2).
void find_contradictions(std::vector<Member>& members, Eigen::Index n) {
  double sum = 0.0, expected = 0.0;
  for (const Member& member : members) {
    sum += member.x.squaredNorm();
    expected += member.trace;
  }
  const double chance2 = 2.0 * std::log(20.0 * static_cast<double>(members.size()) * static_cast<double>(n));
  for (Member& member : members) {
    if (!member.principal) continue;  // (1 − m)⁻¹ is as good as (1 − m)^(−1/2)
    const double others =
        (sum - member.x.squaredNorm()) / std::max(expected - member.trace, std::numeric_limits<double>::min());
    Principal& principal = *member.principal;
    for (Eigen::Index k = 0; k < n; ++k) {
      double& y = principal.y[k];
      if (!(y * y > chance2 * std::max(1.0, others))) continue;
      y /= std::sqrt(principal.rest[k]);
      if (member.contradiction.size() == 0) member.contradiction = VectorXd::Zero(n);
      member.contradiction += y * principal.along.col(k);
    }
    member.x = principal.along * principal.y;
  }
}

/// Scatter of the scores, against what the model expects of it.
struct Scatter {
  MatrixXd seen;      ///< W
  MatrixXd certain;   ///< The part of it that is no chance: contradictions. It is not shrunk.
  MatrixXd expected;  ///< 1, less the priors' information.
  VectorXd dof = {};  ///< Of W along each parameter's direction, by the model.
  double mean = 1.0;  ///< c
  double mean_dof = 1.0;
  double evidence = 0.0;    ///< Which share of the excess over the model is used.
  double shrinkage = 1.0;   ///< λ
  double shared_dof = 1.0;  ///< Of c where it is not 1: the excess is not the same in all directions.

  [[nodiscard]] MatrixXd excess() const {
    const MatrixXd by_chance = (1.0 - shrinkage) * (seen - certain - expected) + shrinkage * (mean - 1.0) * expected;
    return evidence * by_chance + certain;
  }
};

/// The members' shares side by side, n × nN: products with all of them at once.
MatrixXd shares_of(const std::vector<Member>& members, Eigen::Index n) {
  MatrixXd shares(n, n * static_cast<Eigen::Index>(members.size()));
  Eigen::Index at = 0;
  for (const Member& member : members) {
    shares.middleCols(at, n) = member.share;
    at += n;
  }
  return shares;
}

/// Degrees of freedom (Satterthwaite) of Σ (uᵀx)² along each unit direction u, a row: x of two clusters are correlated
/// by −hᵢhₖ, as the others compensate each one's influence (Bell & McCaffrey; Imbens & Kolesár).
VectorXd directional_dof(const MatrixXd& shares, const MatrixXd& directions) {
  const Eigen::Index n = directions.rows(), num = shares.cols() / n;
  const MatrixXd pulls = shares.transpose() * directions.transpose();  // column j: hᵢu, one after the other
  VectorXd dof(n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const Eigen::Map<const MatrixXd> of_direction(pulls.col(j).data(), n, num);
    const Eigen::ArrayXd each = (directions.row(j) * of_direction).transpose().array();
    const Eigen::ArrayXd own = of_direction.colwise().squaredNorm().transpose().array();
    double squares = each.square().sum();
    constexpr double little = 0.02;                // of the degrees of freedom; σ follows by a hundredth of that
    if (own.sum() * own.sum() > little * squares)  // a bound of what follows
      squares += (of_direction * of_direction.transpose()).squaredNorm() - own.square().sum();
    const double sum = each.sum();
    dof[j] = squares > 0.0 ? sum * sum / squares : std::numeric_limits<double>::infinity();  // determined by a prior
  }
  return dof;
}

/// Degrees of freedom of Σ xᵀx, likewise; `total` is what the model expects of it.
double mean_dof(const std::vector<Member>& members, const MatrixXd& shares, double total) {
  double squares = 0.0;
  bool any_large = false;
  for (const Member& member : members) {
    squares += member.share.squaredNorm();
    any_large = any_large || member.principal.has_value();
  }
  // Where every share is small, mutual influences are of second order.
  if (any_large) {
    squares += (shares * shares.transpose()).squaredNorm();
    constexpr double little = 1e-3;  // of the degrees of freedom, all that is left out together
    const double enough = std::sqrt(little * squares / static_cast<double>(members.size()));
    for (const Member& member : members) {
      if (member.share.squaredNorm() > enough) squares -= product(member.share, member.share).squaredNorm();
    }
  }
  return total * total / std::max(squares, 1e-300);
}

/// Weight of the excess over the model, and of each direction's own. The logarithm of c scatters by 2/ν: the share
/// 1 − (2/ν)/ln² c of it is used (empirical Bayes: ln c has the observed variance, less
/// that). An excess of which only the mean b = c − 1 is known is exponentially distributed over directions (maximum
/// entropy); against chance, of variance 2/ν (c² + b²) in a direction, the linear Bayes estimate of it has the weight
/// 1 − λ = b²/(b² + 2/ν (c² + b²)).
void weigh(Scatter& scatter) {
  if (!(scatter.mean > 1.0)) return;
  const double c = scatter.mean, b = c - 1.0, log_c = std::log(c);
  scatter.evidence = std::max(0.0, 1.0 - 2.0 / scatter.mean_dof / (log_c * log_c));
  double finite = 0.0, sum = 0.0;
  for (const double dof : scatter.dof) {
    if (!std::isfinite(dof)) continue;
    sum += dof;
    finite += 1.0;
  }
  if (finite == 0.0) return;
  const double chance = 2.0 * finite / sum * (c * c + b * b);
  scatter.shrinkage = chance / (b * b + chance);
  scatter.shared_dof = scatter.mean_dof / (1.0 + b * b / (c * c));
}

/// `directions`: one unit row a parameter.
Scatter scatter_of(const std::vector<Member>& members, const MatrixXd& directions, bool equal_shares) {
  const Eigen::Index n = directions.cols();
  Scatter scatter{MatrixXd::Zero(n, n), MatrixXd::Zero(n, n), MatrixXd::Zero(n, n)};
  for (const Member& member : members) {
    scatter.seen.noalias() += member.x * member.x.transpose();
    if (member.contradiction.size() > 0) scatter.certain += member.contradiction * member.contradiction.transpose();
    if (!equal_shares) scatter.expected += member.share;
  }
  if (equal_shares) scatter.expected.setIdentity();
  const double total = std::max(scatter.expected.trace(), 1e-12);
  scatter.mean = scatter.seen.trace() / total;
  if (equal_shares) {
    scatter.dof = VectorXd::Constant(n, static_cast<double>(members.size()) - 1.0);
    scatter.mean_dof = scatter.shared_dof = scatter.dof.sum();
  } else {
    const MatrixXd shares = shares_of(members, n);
    scatter.mean_dof = scatter.shared_dof = mean_dof(members, shares, total);
    scatter.dof = directional_dof(shares, directions);
  }
  weigh(scatter);
  return scatter;
}

/// Degrees of freedom of the stated variance along a unit direction: of W and of its mean, as they are mixed.
double stated_dof(const Scatter& scatter, double own_dof, const VectorXd& direction) {
  if (!std::isfinite(own_dof)) return own_dof;
  const double own = direction.dot(scatter.seen * direction), expected = direction.dot(scatter.expected * direction);
  const double mean = scatter.mean * expected;
  const double spread = (1.0 - scatter.shrinkage) * own * std::sqrt(2.0 / own_dof) +
                        scatter.shrinkage * mean * std::sqrt(2.0 / scatter.shared_dof);
  const double value = std::max(expected, (1.0 - scatter.shrinkage) * own + scatter.shrinkage * mean);
  return 2.0 * value * value / (spread * spread);
}

/// The clusters' result where no parameter is fixed, H⁻¹ = L Lᵀ. `clusters` are whitened.
void state_whitened(const MatrixXd& L, double noise_variance, std::vector<ClusterStep>&& clusters,
                    ClusterCovariance& result) {
  const Eigen::Index n = L.rows();
  const bool equal_shares = clusters.front().spread.size() == 0;
  std::vector<Member> members;
  members.reserve(clusters.size());
  const double equal_share = 1.0 / static_cast<double>(clusters.size());
  SmallLeverage small_leverage;
  for (ClusterStep& cluster : clusters) {
    members.push_back(member_of(std::move(cluster), noise_variance, equal_share, small_leverage));
    if (!members.back().x.allFinite()) return;
  }
  find_contradictions(members, n);
  for (const Member& member : members) {
    result.z2.push_back(member.x.squaredNorm() / std::max(member.trace, 1e-12));
  }
  const MatrixXd directions = L.rowwise().normalized();
  const Scatter scatter = scatter_of(members, directions, equal_shares);
  result.design_effect = scatter.mean;
  result.shrinkage = scatter.shrinkage;
  const SymmetricSolver excess(scatter.excess());
  const MatrixXd raised =
      excess.eigenvectors() * excess.eigenvalues().cwiseMax(0.0).asDiagonal() * excess.eigenvectors().transpose();
  VectorXd widen(n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const double dof = stated_dof(scatter, scatter.dof[j], directions.row(j).transpose());
    constexpr double min_dof = 4.0;  // below, a t distribution's variance says little
    widen[j] = std::sqrt(1.0 + 2.0 / (std::max(dof, min_dof) - 2.0));
    result.degrees_of_freedom[j] = dof;
  }
  const MatrixXd widened = widen.asDiagonal() * L;
  result.cov += noise_variance * widened * raised * widened.transpose();
  result.inflation = (result.cov.diagonal().array() / (noise_variance * L.rowwise().squaredNorm().array())).sqrt();
}

/// The same from clusters as they come.
void state_free(const MatrixXd& inverse, double noise_variance, std::span<const ClusterStep> clusters,
                ClusterCovariance& result) {
  const Eigen::Index n = inverse.rows();
  const Eigen::LLT<MatrixXd> llt(inverse);
  if (n == 0 || llt.info() != Eigen::Success || !(noise_variance > 0.0)) return;
  const MatrixXd whiten = llt.matrixL().solve(MatrixXd::Identity(n, n));
  std::vector<ClusterStep> whitened;
  whitened.reserve(clusters.size());
  for (const ClusterStep& cluster : clusters) {
    whitened.push_back({whiten * cluster.step, product(product(whiten, cluster.spread), whiten.transpose()), {}});
    if (cluster.taken.size() > 0) whitened.back().taken = product(product(whiten, cluster.taken), whiten.transpose());
  }
  state_whitened(llt.matrixL(), noise_variance, std::move(whitened), result);
}

/// The model's covariance, which is used where clusters give no information.
ClusterCovariance of_model(MatrixXd cov) {
  const Eigen::Index n = cov.rows();
  ClusterCovariance result;
  result.cov = std::move(cov);
  result.inflation = VectorXd::Ones(n);
  result.degrees_of_freedom = VectorXd::Constant(n, std::numeric_limits<double>::infinity());
  return result;
}

MatrixXd picked(const MatrixXd& full, const std::vector<Eigen::Index>& at) { return full(at, at); }

}  // namespace

ClusterStep cluster_step(const MatrixXd& inverse, const MatrixXd& information, const VectorXd& gradient) {
  return {inverse * gradient, inverse * information * inverse, {}};
}

ClusterCovariance cluster_covariance(const MatrixXd& inverse, double noise_variance,
                                     std::span<const ClusterStep> clusters) {
  const Eigen::Index n = inverse.rows();
  ClusterCovariance result = of_model(noise_variance * inverse);
  if (clusters.size() < ClusterCovariance::min_clusters) return result;
  std::vector<Eigen::Index> free;
  for (Eigen::Index j = 0; j < n; ++j) {
    if (inverse(j, j) > 0.0) free.push_back(j);
  }
  if (free.size() == static_cast<std::size_t>(n)) {
    state_free(inverse, noise_variance, clusters, result);
    return result;
  }
  std::vector<ClusterStep> steps;
  steps.reserve(clusters.size());
  for (const ClusterStep& cluster : clusters) {
    steps.push_back({cluster.step(free), picked(cluster.spread, free), {}});
    if (cluster.taken.size() > 0) steps.back().taken = picked(cluster.taken, free);
  }
  ClusterCovariance of_free = of_model(picked(result.cov, free));
  state_free(picked(inverse, free), noise_variance, steps, of_free);
  for (std::size_t i = 0; i < free.size(); ++i) {
    for (std::size_t j = 0; j < free.size(); ++j) {
      result.cov(free[i], free[j]) = of_free.cov(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
    }
    result.inflation[free[i]] = of_free.inflation[static_cast<Eigen::Index>(i)];
    result.degrees_of_freedom[free[i]] = of_free.degrees_of_freedom[static_cast<Eigen::Index>(i)];
  }
  result.design_effect = of_free.design_effect;
  result.shrinkage = of_free.shrinkage;
  result.z2 = std::move(of_free.z2);
  return result;
}

ClusterCovariance whitened_cluster_covariance(const MatrixXd& L, double noise_variance,
                                              std::vector<ClusterStep> clusters) {
  ClusterCovariance result = of_model(noise_variance * L * L.transpose());
  if (clusters.size() >= ClusterCovariance::min_clusters && L.rows() > 0 && noise_variance > 0.0)
    state_whitened(L, noise_variance, std::move(clusters), result);
  return result;
}

Check clusters_agree(const ClusterCovariance& covariance, const std::string& cluster, const std::string& causes,
                     const std::string& figure) {
  constexpr double usual = 3.0;  // beyond it, what the clusters' measurements share is the larger part by far
  Check check{.name = cluster + "s agree",
              .value = covariance.largest_inflation(),
              .limit = usual,
              .unit = "",
              .figure = figure};
  if (covariance.z2.empty()) {
    check.state = State::care;
    check.text = "too few " + cluster + "s to see whether they agree: σ is that of single measurements";
    return check;
  }
  check.state = check.value <= usual ? State::good : State::care;
  const double common = std::sqrt(covariance.design_effect);
  check.text = common < 1.25 && check.value < 1.5
                   ? cluster + "s scatter as their noise says: σ is " + text_of(check.value, 2) +
                         " times that of single measurements at most"
                   : "errors are shared within a " + cluster + " (" + causes + "): σ is up to " +
                         text_of(check.value, 2) + " times what single measurements alone would give";
  return check;
}

}  // namespace alidade
