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

/// Least rest 1 − h along a direction. A cluster that alone tells it has no residual in it: 0/0 is left at 0.
constexpr double min_rest = 1e-3;

/// A cluster where the model's covariance is 1. Its measurements of what is asked for, made orthonormal, pull by y: by
/// the model of covariance 1 − m, m their leverage. `along` holds what a unit of each principal y moves, `rest` 1 − m
/// along it, `y` its value over √rest: by the model of variance 1.
struct Principal {
  MatrixXd along;
  VectorXd y, rest;
};

/// x: the score, by the model of mean 0 and covariance `share`.
struct Member {
  MatrixXd share;
  VectorXd x;
  VectorXd contradiction;  ///< The part of x along directions in which the cluster contradicts the others; empty: none.
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

/// `whiten` is L⁻¹ with L Lᵀ = H⁻¹.
Member member_of(const ClusterStep& cluster, const MatrixXd& whiten, double noise_variance) {
  Member member;
  member.share = product(product(whiten, cluster.spread), whiten.transpose());
  const VectorXd step = whiten * cluster.step / std::sqrt(noise_variance);
  const bool has_taken = cluster.taken.size() > 0;
  MatrixXd taken, leverage;
  if (has_taken) {
    taken = product(product(whiten, cluster.taken), whiten.transpose());
    leverage = member.share.ldlt().solve(taken).transpose();
  }
  const MatrixXd& m = has_taken ? leverage : member.share;
  constexpr double small = 0.2;  // a bound of the leverage: the series below is right to 5e-4
  if (m.trace() < small) {
    const VectorXd once = m * step, twice = m * once;
    member.x = step + 0.5 * once + 0.375 * twice + 0.3125 * (m * twice);
    return member;
  }
  member.principal = principal_of(member.share, has_taken ? &taken : nullptr, step);
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
    expected += member.share.trace();
  }
  const double chance2 = 2.0 * std::log(20.0 * static_cast<double>(members.size()) * static_cast<double>(n));
  for (Member& member : members) {
    if (!member.principal) continue;  // (1 − m)⁻¹ is as good as (1 − m)^(−1/2)
    const double others =
        (sum - member.x.squaredNorm()) / std::max(expected - member.share.trace(), std::numeric_limits<double>::min());
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
  MatrixXd expected;  ///< 1, less what priors tell.
  VectorXd dof = {};  ///< Of W along each parameter's direction, by the model.
  double mean = 1.0;  ///< c
  double mean_dof = 1.0;
  double evidence = 0.0;    ///< Which share of the excess over the model is believed.
  double shrinkage = 1.0;   ///< λ
  double shared_dof = 1.0;  ///< Of c where it is not 1: the excess is not the same in all directions.

  [[nodiscard]] MatrixXd excess() const {
    const MatrixXd by_chance = (1.0 - shrinkage) * (seen - certain - expected) + shrinkage * (mean - 1.0) * expected;
    return evidence * by_chance + certain;
  }
};

/// Degrees of freedom (Satterthwaite) of Σ (uᵀx)² along each unit direction u, a row: x of two clusters hang together
/// by −hᵢhₖ, as what one pulls the others pull back (Bell & McCaffrey; Imbens & Kolesár).
VectorXd directional_dof(const std::vector<Member>& members, const MatrixXd& directions) {
  const Eigen::Index n = directions.rows(), num = static_cast<Eigen::Index>(members.size());
  MatrixXd pulls(n * n, num);  // a column a member: hᵢu of every direction, one after the other
  for (Eigen::Index i = 0; i < num; ++i)
    pulls.col(i) = product(members[static_cast<std::size_t>(i)].share, directions.transpose()).reshaped();
  VectorXd dof(n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const MatrixXd of_direction = pulls.middleRows(j * n, n);
    const Eigen::ArrayXd shares = (directions.row(j) * of_direction).transpose().array();
    const Eigen::ArrayXd own = of_direction.colwise().squaredNorm().transpose().array();
    const double together = (of_direction * of_direction.transpose()).squaredNorm() - own.square().sum();
    const double squares = shares.square().sum() + together, sum = shares.sum();
    dof[j] = squares > 0.0 ? sum * sum / squares : std::numeric_limits<double>::infinity();  // a prior tells it
  }
  return dof;
}

/// How far the excess over the model is believed, and how far in each direction by itself. The logarithm of c scatters
/// by 2/ν: the share 1 − (2/ν)/ln² c of it is believed (empirical Bayes: ln c has the variance that is seen, less
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
Scatter scatter_of(const std::vector<Member>& members, const MatrixXd& directions) {
  const Eigen::Index n = directions.cols();
  Scatter scatter{MatrixXd::Zero(n, n), MatrixXd::Zero(n, n), MatrixXd::Zero(n, n)};
  MatrixXd shares2 = MatrixXd::Zero(n, n);
  double squares = 0.0;
  for (const Member& member : members) {
    scatter.seen += member.x * member.x.transpose();
    if (member.contradiction.size() > 0) scatter.certain += member.contradiction * member.contradiction.transpose();
    scatter.expected += member.share;
    const MatrixXd share2 = product(member.share, member.share);
    shares2 += share2;
    squares += member.share.squaredNorm() - share2.squaredNorm();
  }
  squares += shares2.squaredNorm();
  const double total = std::max(scatter.expected.trace(), 1e-12);
  scatter.mean = scatter.seen.trace() / total;
  scatter.mean_dof = scatter.shared_dof = total * total / std::max(squares, 1e-300);
  scatter.dof = directional_dof(members, directions);
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

/// What the clusters say where no parameter is held.
void state_free(const MatrixXd& inverse, double noise_variance, std::span<const ClusterStep> clusters,
                ClusterCovariance& result) {
  const Eigen::Index n = inverse.rows();
  const Eigen::LLT<MatrixXd> llt(inverse);
  if (n == 0 || llt.info() != Eigen::Success || !(noise_variance > 0.0)) return;
  const MatrixXd L = llt.matrixL();
  const MatrixXd whiten = llt.matrixL().solve(MatrixXd::Identity(n, n));
  std::vector<Member> members;
  members.reserve(clusters.size());
  for (const ClusterStep& cluster : clusters) {
    members.push_back(member_of(cluster, whiten, noise_variance));
    if (!members.back().x.allFinite()) return;
  }
  find_contradictions(members, n);
  for (const Member& member : members) {
    result.z2.push_back(member.x.squaredNorm() / std::max(member.share.trace(), 1e-12));
  }
  const MatrixXd directions = L.rowwise().normalized();
  const Scatter scatter = scatter_of(members, directions);
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
  result.cov = noise_variance * (inverse + widened * raised * widened.transpose());
  result.inflation = (result.cov.diagonal().array() / (noise_variance * inverse.diagonal().array())).sqrt();
}

MatrixXd picked(const MatrixXd& full, const std::vector<Eigen::Index>& at) { return full(at, at); }

}  // namespace

ClusterStep cluster_step(const MatrixXd& inverse, const MatrixXd& information, const VectorXd& gradient) {
  return {inverse * gradient, inverse * information * inverse, {}};
}

ClusterCovariance cluster_covariance(const MatrixXd& inverse, double noise_variance,
                                     std::span<const ClusterStep> clusters) {
  const Eigen::Index n = inverse.rows();
  ClusterCovariance result;
  result.cov = noise_variance * inverse;
  result.inflation = VectorXd::Ones(n);
  result.degrees_of_freedom = VectorXd::Constant(n, std::numeric_limits<double>::infinity());
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
  const auto num_free = static_cast<Eigen::Index>(free.size());
  ClusterCovariance of_free{.cov = picked(result.cov, free),
                            .inflation = VectorXd::Ones(num_free),
                            .degrees_of_freedom = result.degrees_of_freedom(free)};
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
