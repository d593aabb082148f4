#include "alidade/estimation/cluster_covariance.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

namespace alidade {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using SymmetricSolver = Eigen::SelfAdjointEigenSolver<MatrixXd>;

/// A cluster where the model's covariance is 1: its share h of the information with its principal directions Q, and
/// along these its step, by the model of variance h(1 − h).
struct Member {
  MatrixXd share;
  MatrixXd Q;
  VectorXd h, rest, along;  ///< rest = 1 − h
};

/// `whiten` is L⁻¹ with L Lᵀ = H⁻¹.
Member member_of(const ClusterStep& cluster, const MatrixXd& whiten, double noise_variance) {
  Member member;
  member.share = whiten * cluster.spread * whiten.transpose();
  const SymmetricSolver eigen(0.5 * (member.share + member.share.transpose()));
  member.Q = eigen.eigenvectors();
  member.h = eigen.eigenvalues().cwiseMax(1e-12);
  // A cluster that alone tells a direction has no residual in it: 0/0 is left at 0.
  constexpr double least_rest = 1e-3;
  member.rest = (1.0 - eigen.eigenvalues().array()).max(least_rest);
  member.along = member.Q.transpose() * (whiten * cluster.step) / std::sqrt(noise_variance);
  return member;
}

/// A cluster's score: by the model of mean 0 and covariance `share`.
struct Score {
  VectorXd x;
  VectorXd contradiction;  ///< The part of x along directions in which the cluster contradicts the others.
  MatrixXd share;
};

/// Scores by CR2. Along a direction in which a cluster contradicts the others by more than 3σ, in units of their design
/// effect, the whole change that its deletion causes counts (CR3): an answer that hangs on it is that uncertain.
std::vector<Score> scores_of(const std::vector<Member>& members) {
  std::vector<VectorXd> along;
  double sum = 0.0, expected = 0.0;
  for (const Member& member : members) {
    along.emplace_back(member.along.cwiseQuotient(member.rest.cwiseSqrt()));
    sum += along.back().squaredNorm();
    expected += member.share.trace();
  }
  std::vector<Score> scores;
  scores.reserve(members.size());
  for (std::size_t i = 0; i < members.size(); ++i) {
    const Member& member = members[i];
    VectorXd& x = along[i];
    const double others = (sum - x.squaredNorm()) / std::max(expected - member.share.trace(), 1e-12);
    constexpr double chance2 = 9.0;  // 3σ
    VectorXd contradiction = VectorXd::Zero(x.size());
    for (Eigen::Index k = 0; k < x.size(); ++k) {
      if (!(x[k] * x[k] > chance2 * std::max(1.0, others) * member.h[k])) continue;
      contradiction[k] = x[k] /= std::sqrt(member.rest[k]);
    }
    scores.push_back({member.Q * x, member.Q * contradiction, member.share});
  }
  return scores;
}

/// Scatter of the scores, against what the model expects of it.
struct Scatter {
  MatrixXd seen;      ///< W
  MatrixXd certain;   ///< The part of it that is no chance: contradictions. It is not shrunk.
  MatrixXd expected;  ///< 1, less what priors tell.
  double mean = 1.0;  ///< c
  double mean_dof = 1.0;
  double shrinkage = 1.0;

  [[nodiscard]] MatrixXd shrunk() const { return (1.0 - shrinkage) * seen + shrinkage * (mean * expected + certain); }
};

Scatter scatter_of(const std::vector<Score>& scores, Eigen::Index n) {
  Scatter scatter{MatrixXd::Zero(n, n), MatrixXd::Zero(n, n), MatrixXd::Zero(n, n)};
  double squares = 0.0;
  for (const Score& score : scores) {
    scatter.seen += score.x * score.x.transpose();
    scatter.certain += score.contradiction * score.contradiction.transpose();
    scatter.expected += score.share;
    squares += score.share.squaredNorm();
  }
  const double total = std::max(scatter.expected.trace(), 1e-12);
  scatter.mean = scatter.seen.trace() / total;
  scatter.mean_dof = total * total / std::max(squares, 1e-300);
  double noise2 = 0.0;
  for (const Score& score : scores) {
    noise2 += (score.x * score.x.transpose() - scatter.mean * score.share).squaredNorm();
  }
  const double distance2 = (scatter.seen - scatter.mean * scatter.expected).squaredNorm();
  scatter.shrinkage = distance2 > noise2 ? noise2 / distance2 : 1.0;
  return scatter;
}

/// Degrees of freedom of the stated variance along a unit direction: of W and of its mean, as they are mixed.
double degrees_of_freedom(const Scatter& scatter, const std::vector<Score>& scores, const VectorXd& direction) {
  double sum = 0.0, squares = 0.0;
  for (const Score& score : scores) {
    const double share = direction.dot(score.share * direction);
    sum += share;
    squares += share * share;
  }
  if (!(squares > 0.0)) return std::numeric_limits<double>::infinity();  // a prior tells it
  const double own = direction.dot(scatter.seen * direction), expected = direction.dot(scatter.expected * direction);
  const double mean = scatter.mean * expected;
  const double spread = (1.0 - scatter.shrinkage) * own * std::sqrt(2.0 * squares) / sum +
                        scatter.shrinkage * mean * std::sqrt(2.0 / scatter.mean_dof);
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
    if (!members.back().along.allFinite()) return;
  }
  const std::vector<Score> scores = scores_of(members);
  for (const Score& score : scores) {
    result.z2.push_back(score.x.squaredNorm() / std::max(score.share.trace(), 1e-12));
  }
  const Scatter scatter = scatter_of(scores, n);
  result.design_effect = scatter.mean;
  result.shrinkage = scatter.shrinkage;
  const SymmetricSolver excess(scatter.shrunk() - scatter.expected);
  const MatrixXd raised =
      excess.eigenvectors() * excess.eigenvalues().cwiseMax(0.0).asDiagonal() * excess.eigenvectors().transpose();
  VectorXd widen(n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const double dof = degrees_of_freedom(scatter, scores, L.row(j).transpose().normalized());
    constexpr double least_dof = 4.0;  // below, a t distribution's variance says little
    widen[j] = std::sqrt(1.0 + 2.0 / (std::max(dof, least_dof) - 2.0));
    result.degrees_of_freedom[j] = dof;
  }
  const MatrixXd widened = widen.asDiagonal() * L;
  result.cov = noise_variance * (inverse + widened * raised * widened.transpose());
  result.inflation = (result.cov.diagonal().array() / (noise_variance * inverse.diagonal().array())).sqrt();
}

MatrixXd picked(const MatrixXd& full, const std::vector<Eigen::Index>& at) { return full(at, at); }

}  // namespace

ClusterStep cluster_step(const MatrixXd& inverse, const MatrixXd& information, const VectorXd& gradient) {
  return {inverse * gradient, inverse * information * inverse};
}

ClusterCovariance cluster_covariance(const MatrixXd& inverse, double noise_variance,
                                     std::span<const ClusterStep> clusters) {
  const Eigen::Index n = inverse.rows();
  ClusterCovariance result;
  result.cov = noise_variance * inverse;
  result.inflation = VectorXd::Ones(n);
  result.degrees_of_freedom = VectorXd::Constant(n, std::numeric_limits<double>::infinity());
  if (clusters.size() < ClusterCovariance::least_clusters) return result;
  std::vector<Eigen::Index> free;
  for (Eigen::Index j = 0; j < n; ++j) {
    if (inverse(j, j) > 0.0) free.push_back(j);
  }
  std::vector<ClusterStep> steps;
  steps.reserve(clusters.size());
  for (const ClusterStep& cluster : clusters) steps.push_back({cluster.step(free), picked(cluster.spread, free)});
  const auto num_free = static_cast<Eigen::Index>(free.size());
  ClusterCovariance of_free{picked(result.cov, free), VectorXd::Ones(num_free), result.degrees_of_freedom(free)};
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
