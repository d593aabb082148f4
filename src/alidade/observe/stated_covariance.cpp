#include "alidade/observe/stated_covariance.h"

#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int most_blocks = 24, least_blocks = 6;
constexpr double correlations_a_block = 5.0;
constexpr std::size_t tracks_looked_at = 64;

/// Score and information of a cluster.
struct Part {
  explicit Part(Eigen::Index n = 0) : gradient(VectorXd::Zero(n)), information(MatrixXd::Zero(n, n)) {}
  VectorXd gradient;
  MatrixXd information;
};

struct Parts {
  std::vector<Part> blocks, tracks;
  MatrixXd both;  ///< Σ g gᵀ over track × block.
};

double duration_of(const Adjustment& reference) {
  const auto& frames = reference.bundle.frames;
  return frames.empty() ? 0.0 : frames.back().t_s - frames.front().t_s;
}

Parts parts_of(const Adjustment& reference, const ObserveNuisances& nuisances, int num_blocks) {
  const RotationBundle& bundle = reference.bundle;
  ObserveNuisances without_turn = nuisances;
  without_turn.turn = false;
  const CommonLayout layout(without_turn);
  const Eigen::Index n = layout.size;
  Parts parts{std::vector<Part>(static_cast<std::size_t>(num_blocks), Part(n)),
              std::vector<Part>(bundle.points.size(), Part(n)), MatrixXd::Zero(n, n)};
  std::vector<VectorXd> open(bundle.points.size(), VectorXd::Zero(n));  // a track's score in the block of now
  const auto close = [&] {
    for (VectorXd& score : open) {
      parts.both.noalias() += score * score.transpose();
      score.setZero();
    }
  };
  const double from_s = bundle.frames.front().t_s, block_s = duration_of(reference) / num_blocks;
  int frame = -1, block = 0;
  std::optional<RotationView> view;
  RotationPrediction p;
  for (std::size_t i = 0; i < bundle.observations.size(); ++i) {
    const BundleObservation& seen = bundle.observations[i];
    if (seen.frame != frame) {
      const RotationFrame& now = bundle.frames[static_cast<std::size_t>(frame = seen.frame)];
      view.emplace(reference.solution.camera, now);
      const int next = std::clamp(static_cast<int>((now.t_s - from_s) / block_s), 0, num_blocks - 1);
      if (next != block) close();
      block = next;
    }
    const auto point = static_cast<std::size_t>(seen.point);
    if (!view->predict(reference.solution.points[point], layout, p)) continue;
    const PointGivenCommon& given = reference.solution.given_common[point];
    const PixelByCommon J = p.J_px_common.leftCols(n) + p.J_px_point * given.slope;
    const double weight = residual_weight(reference, i);
    const VectorXd gradient = weight * J.transpose() * (p.px - seen.px);
    const MatrixXd information = weight * J.transpose() * J;
    for (Part* part : {&parts.blocks[static_cast<std::size_t>(block)], &parts.tracks[point]}) {
      part->gradient += gradient;
      part->information += information;
    }
    open[point] += gradient;
  }
  close();
  return parts;
}

/// What the tracks share beyond what their parts of one block do, where the model's covariance is 1.
MatrixXd track_excess(const Parts& parts, const MatrixXd& L, StatedCovariance& stated) {
  const Eigen::Index n = L.rows();
  MatrixXd tracks = MatrixXd::Zero(n, n);
  double count = 0.0;
  for (const Part& part : parts.tracks) {
    if (part.gradient.isZero(0.0)) continue;
    tracks += part.gradient * part.gradient.transpose();
    count += 1.0;
  }
  const MatrixXd none = MatrixXd::Zero(n, n);
  if (count < 3.0) return none;
  tracks *= count / (count - 1.0);  // the estimate follows each track by its share
  const MatrixXd by_track = L.transpose() * tracks * L, by_both = L.transpose() * parts.both * L;
  stated.track_effect = by_track.trace() / std::max(by_both.trace(), 1e-12);
  stated.counts_tracks = stated.track_effect > 1.0 + 3.0 * std::sqrt(2.0 / (count - 1.0));
  return stated.counts_tracks ? MatrixXd(by_track - by_both) : none;
}

MatrixXd made_positive(const MatrixXd& symmetric) {
  const SymmetricEigen eigen = symmetric_eigen(symmetric);
  return eigen.vectors * eigen.values.cwiseMax(0.0).asDiagonal() * eigen.vectors.transpose();
}

/// Σ r(t)·r(t + lag) over the tracks, by the lag; what lies beyond Huber's limit is drawn in.
std::vector<double> products_by_lag(const Adjustment& reference) {
  const RotationBundle& bundle = reference.bundle;
  const std::size_t every = std::max<std::size_t>(1, bundle.points.size() / tracks_looked_at);
  std::vector<std::vector<Eigen::Vector2d>> tracks(bundle.points.size());
  const double limit = RotationBundleConfig{}.huber * reference.sigma_px;
  for (std::size_t i = 0; i < bundle.observations.size(); ++i) {
    const auto point = static_cast<std::size_t>(bundle.observations[i].point);
    const Eigen::Vector2d& residual = reference.solution.residuals[i];
    if (point % every != 0 || !residual.allFinite()) continue;
    tracks[point].push_back(residual.norm() > limit ? Eigen::Vector2d(residual * (limit / residual.norm())) : residual);
  }
  std::vector<double> product(std::min<std::size_t>(bundle.frames.size() / 4, 600) + 1, 0.0);
  for (std::size_t lag = 0; lag < product.size(); ++lag) {
    for (const auto& track : tracks) {
      for (std::size_t k = lag; k < track.size(); ++k) product[lag] += track[k].dot(track[k - lag]);
    }
    if (product[lag] < 0.0) {
      product.resize(lag);  // beyond the first lag without correlation there is none to be summed
      break;
    }
  }
  return product;
}

/// τ [frames] for which Σ k exp(−k/τ) / Σ exp(−k/τ), k = 1 … last, is `mean_lag`: whatever share of the noise does not
/// last. At most `last`: correlations of a longer one would not have ended there.
double lasting_frames(double mean_lag, double last) {
  const auto mean_for = [last](double tau) {
    double sum = 0.0, lag_sum = 0.0;
    for (double k = 1.0; k <= last; k += 1.0) {
      const double correlation = std::exp((1.0 - k) / tau);
      sum += correlation;
      lag_sum += k * correlation;
    }
    return lag_sum / sum;
  };
  double low = 0.05, high = last;
  constexpr int halvings = 30;
  for (int i = 0; i < halvings; ++i) {
    const double middle = 0.5 * (low + high);
    (mean_for(middle) < mean_lag ? low : high) = middle;
  }
  return high;
}

}  // namespace

double seen_within(double block_s, double correlation_s) {
  const double ratio = std::max(block_s / std::max(correlation_s, 1e-9), 1.0);
  return 1.0 - (1.0 - std::exp(-ratio)) / ratio;
}

double residual_weight(const Adjustment& reference, std::size_t observation) {
  const double sigma = reference.sigma_px, huber = RotationBundleConfig{}.huber;
  const double norm = reference.solution.residual_px[observation] / sigma;
  return (norm > huber ? huber / norm : 1.0) / (sigma * sigma);
}

double residual_correlation_s(const Adjustment& reference) {
  const std::vector<double> product = products_by_lag(reference);
  const auto num_frames = static_cast<double>(reference.bundle.frames.size());
  if (product.size() < 2 || !(product[0] > 0.0)) return 0.0;
  // A point's bearing takes the mean of its track's errors with it: all products lose that mean's variance.
  double lost = 0.0, lag_sum = 0.0, sum = 0.0, last = 0.0;
  constexpr int rounds = 20;
  for (int round = 0; round < rounds; ++round) {
    lag_sum = sum = last = 0.0;
    double of_mean = 1.0;
    for (std::size_t lag = 1; lag < product.size(); ++lag) {
      const double k = static_cast<double>(lag), pairs = 1.0 - k / num_frames;
      const double correlation = (product[lag] / (product[0] * pairs)) * (1.0 - lost) + lost;
      constexpr double nothing = 0.05;
      if (correlation < nothing) break;
      last = k;
      sum += correlation;
      lag_sum += k * correlation;
      of_mean += 2.0 * pairs * correlation;
    }
    constexpr double most_lost = 0.5;
    lost = std::min(of_mean / num_frames, most_lost);
  }
  if (!(sum > 0.0)) return 0.0;
  const double frame_s = duration_of(reference) / std::max(1.0, num_frames - 1.0);
  return lasting_frames(lag_sum / sum, last) * frame_s;
}

StatedCovariance stated_covariance(const Adjustment& reference, const ObserveNuisances& nuisances) {
  StatedCovariance stated;
  const MatrixXd model = reference.solution.covariance();
  stated.cov = model;
  stated.inflation = VectorXd::Ones(model.rows());
  const double duration_s = duration_of(reference);
  const bool has_turns = reference.solution.given_common.size() != reference.bundle.points.size();
  if (has_turns || !model.allFinite() || !(duration_s > 0.0)) return stated;
  stated.correlation_s = residual_correlation_s(reference);
  const double wanted = duration_s / std::max(correlations_a_block * stated.correlation_s, 1e-9);
  const int frames_allow = static_cast<int>(reference.bundle.frames.size() / 3);
  const int num_blocks =
      std::min(static_cast<int>(std::clamp<double>(wanted, least_blocks, most_blocks)), frames_allow);
  const Eigen::LLT<MatrixXd> llt(model);
  if (num_blocks < 3 || llt.info() != Eigen::Success) return stated;
  stated.block_s = duration_s / num_blocks;
  const Parts parts = parts_of(reference, nuisances, num_blocks);
  const double scale = 1.0 / std::sqrt(seen_within(stated.block_s, stated.correlation_s));
  std::vector<ClusterStep> steps;
  for (const Part& part : parts.blocks) {
    steps.push_back(cluster_step(model, part.information, scale * part.gradient));
  }
  stated.blocks = cluster_covariance(model, 1.0, steps);
  const MatrixXd L = llt.matrixL();
  stated.cov = stated.blocks.cov + L * made_positive(track_excess(parts, L, stated)) * L.transpose();
  stated.inflation = (stated.cov.diagonal().array() / model.diagonal().array()).sqrt();
  return stated;
}

}  // namespace alidade
