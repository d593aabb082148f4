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

/// A cluster where the model's covariance is 1: its share h of the information and its step d, by the model of
/// covariance h(1 − h); x = (1 − h)^(−1/2) d.
struct Member {
  MatrixXd share;
  VectorXd step, x;
  double trace = 0.0;
  std::optional<SymmetricSolver> eigen;  ///< Of the share, where it is large.
};

/// Rest 1 − h along a principal direction. A cluster that alone tells it has no residual in it: 0/0 is left at 0.
double rest_of(double h) { return std::max(1.0 - h, 1e-3); }

/// `whiten` is L⁻¹ with L Lᵀ = H⁻¹.
Member member_of(const ClusterStep& cluster, const MatrixXd& whiten, double noise_variance) {
  Member member;
  const MatrixXd half_way = whiten * cluster.spread;
  member.share = half_way * whiten.transpose();
  member.step = whiten * cluster.step / std::sqrt(noise_variance);
  member.trace = member.share.trace();
  constexpr double small = 0.2;  // a bound of h: the series below is right to 5e-4
  if (member.trace < small) {
    const VectorXd once = member.share * member.step, twice = member.share * once;
    member.x = member.step + 0.5 * once + 0.375 * twice + 0.3125 * (member.share * twice);
    return member;
  }
  member.eigen.emplace(0.5 * (member.share + member.share.transpose()));
  const MatrixXd& Q = member.eigen->eigenvectors();
  const VectorXd scale = member.eigen->eigenvalues().unaryExpr([](double h) { return 1.0 / std::sqrt(rest_of(h)); });
  member.x = Q * scale.cwiseProduct(Q.transpose() * member.step);
  return member;
}

/// The part of x along directions in which the cluster contradicts the others by more than 3σ, in units of their design
/// effect, as its deletion changes the answer: (1 − h)⁻¹ d. `x` takes it over.
VectorXd contradiction(const Member& member, double others, VectorXd& x) {
  VectorXd found = VectorXd::Zero(x.size());
  if (!member.eigen) return found;  // (1 − h)⁻¹ is as good as (1 − h)^(−1/2)
  constexpr double chance2 = 9.0;
  const MatrixXd& Q = member.eigen->eigenvectors();
  VectorXd along = Q.transpose() * x;
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    const double h = std::max(member.eigen->eigenvalues()[k], 1e-12);
    if (!(along[k] * along[k] > chance2 * std::max(1.0, others) * h)) continue;
    along[k] /= std::sqrt(rest_of(h));
    found += along[k] * Q.col(k);
  }
  x = Q * along;
  return found;
}

/// A cluster's score: by the model of mean 0 and covariance `share`.
struct Score {
  VectorXd x;
  VectorXd contradiction;  ///< The part of x along directions in which the cluster contradicts the others.
  MatrixXd share;
};

std::vector<Score> scores_of(std::vector<Member> members) {
  double sum = 0.0, expected = 0.0;
  for (const Member& member : members) {
    sum += member.x.squaredNorm();
    expected += member.trace;
  }
  std::vector<Score> scores;
  scores.reserve(members.size());
  for (Member& member : members) {
    VectorXd x = member.x;
    const double others = (sum - x.squaredNorm()) / std::max(expected - member.trace, 1e-12);
    VectorXd against = contradiction(member, others, x);
    scores.push_back({std::move(x), std::move(against), std::move(member.share)});
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
    if (!members.back().x.allFinite()) return;
  }
  const std::vector<Score> scores = scores_of(std::move(members));
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
