#include "alidade/observe/checks/stated_covariance.h"

#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/observe/checks/eliminated_rotations.h"

namespace alidade {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int max_blocks = 24, min_blocks = 6;
constexpr double correlations_a_block = 5.0;
constexpr std::size_t tracks_looked_at = 64;

/// Score and information of a cluster.
struct Part {
  explicit Part(Eigen::Index n = 0) : gradient(VectorXd::Zero(n)), information(MatrixXd::Zero(n, n)) {}
  VectorXd gradient;
  MatrixXd information;  ///< For a block: covariance of its score, with errors that last along tracks.
};

/// Decayed sum of a track's earlier scores, for exponentially correlated errors: Σ exp(−Δt/τ) Jᵀw.
struct Memory {
  MatrixXd of_all, of_block;  ///< n × 2; `of_block` since the start of the current block.
  double t_s = 0.0;
};

struct Parts {
  std::vector<Part> blocks, tracks;
  MatrixXd lasting;  ///< Covariance of the whole score, with errors that last along the tracks.
};

double duration_of(const Adjustment& reference) {
  const auto& frames = reference.bundle.frames;
  return frames.empty() ? 0.0 : frames.back().t_s - frames.front().t_s;
}

/// Adds the covariance of a pixel's score with the earlier ones of its track; `half` · unit noise is the score.
void add_lasting(const MatrixXd& half, double now_s, const LastingErrors& errors, Memory& before, MatrixXd& all,
                 MatrixXd& of_block) {
  const double fade = std::exp(-(now_s - before.t_s) / errors.seconds);
  before.of_all *= fade;
  before.of_block *= fade;
  before.t_s = now_s;
  const MatrixXd shared = errors.share * half * before.of_all.transpose();
  const MatrixXd shared_in_block = errors.share * half * before.of_block.transpose();
  all += shared + shared.transpose();
  of_block += shared_in_block + shared_in_block.transpose();
  before.of_all += half;
  before.of_block += half;
}

/// The derivatives of each observation by the shared parameters, with points and rotations eliminated.
class Derivatives {
 public:
  Derivatives(const Adjustment& reference, const ObserveNuisances& nuisances)
      : reference_(reference), layout_(with_rotation(nuisances, false)), wide_(with_rotation(nuisances, true)) {
    if (!has_rotations(reference.solution)) return;
    rotations_.emplace(reference, size());
    for (std::size_t i = 0; i < reference.bundle.observations.size(); ++i) {
      if (predict(i))
        rotations_->add(reference.bundle.observations[i], residual_weight(reference, i),
                        p_.J_px_common.leftCols(size()), p_.J_px_common.middleCols<3>(wide_.rotation), p_.J_px_point);
    }
    rotations_->solve();
  }

  [[nodiscard]] Eigen::Index size() const { return layout_.size; }
  [[nodiscard]] const std::optional<EliminatedRotations>& rotations() const { return rotations_; }
  /// J, and prediction minus pixel. False: the point has no pixel.
  bool at(std::size_t i, MatrixXd& J, Eigen::Vector2d& error) {
    if (!predict(i)) return false;
    const BundleObservation& seen = reference_.bundle.observations[i];
    error = p_.px - seen.px;
    J = p_.J_px_common.leftCols(size());
    if (rotations_)
      J = rotations_->followed(seen, J, p_.J_px_common.middleCols<3>(wide_.rotation), p_.J_px_point);
    else
      J += p_.J_px_point * reference_.solution.given_common[static_cast<std::size_t>(seen.point)].slope;
    return true;
  }

 private:
  static ObserveNuisances with_rotation(ObserveNuisances nuisances, bool has_it) {
    nuisances.rotation = has_it;
    return nuisances;
  }
  bool predict(std::size_t i) {
    const BundleObservation& seen = reference_.bundle.observations[i];
    if (seen.frame != frame_) view_.emplace(reference_.solution.camera, rotated_frame(reference_, frame_ = seen.frame));
    return view_->predict(reference_.solution.points[static_cast<std::size_t>(seen.point)],
                          has_rotations(reference_.solution) ? wide_ : layout_, p_);
  }

  const Adjustment& reference_;
  CommonLayout layout_, wide_;
  std::optional<EliminatedRotations> rotations_;
  std::optional<RotationView> view_;
  RotationPrediction p_;
  int frame_ = -1;
};

/// The prior of each rotation counts as one more measurement.
void add_rotations(const EliminatedRotations& rotations, const std::vector<int>& block_of_frame, Parts& parts) {
  for (std::size_t k = 0; k < block_of_frame.size(); ++k) {
    Part& block = parts.blocks[static_cast<std::size_t>(block_of_frame[k])];
    MatrixXd information = MatrixXd::Zero(parts.lasting.rows(), parts.lasting.cols());
    rotations.add_prior(static_cast<int>(k), block.gradient, information);
    block.information += information;
    parts.lasting += information;
  }
}

Parts parts_of(const Adjustment& reference, const ObserveNuisances& nuisances, int num_blocks,
               const LastingErrors& errors) {
  const RotationBundle& bundle = reference.bundle;
  Derivatives derivatives(reference, nuisances);
  const Eigen::Index n = derivatives.size();
  Parts parts{std::vector<Part>(static_cast<std::size_t>(num_blocks), Part(n)),
              std::vector<Part>(bundle.points.size(), Part(n)), MatrixXd::Zero(n, n)};
  std::vector<Memory> memory(bundle.points.size(), {MatrixXd::Zero(n, 2), MatrixXd::Zero(n, 2)});
  const double from_s = bundle.frames.front().t_s, block_s = duration_of(reference) / num_blocks;
  std::vector<int> block_of_frame;
  for (const RotationFrame& frame : bundle.frames)
    block_of_frame.push_back(std::clamp(static_cast<int>((frame.t_s - from_s) / block_s), 0, num_blocks - 1));
  int block = 0;
  MatrixXd J;
  Eigen::Vector2d error;
  for (std::size_t i = 0; i < bundle.observations.size(); ++i) {
    const BundleObservation& seen = bundle.observations[i];
    const auto frame = static_cast<std::size_t>(seen.frame), point = static_cast<std::size_t>(seen.point);
    const int next = block_of_frame[frame];
    for (std::size_t k = 0; next != block && k < memory.size(); ++k) memory[k].of_block.setZero();
    block = next;
    if (!derivatives.at(i, J, error)) continue;
    const double weight = residual_weight(reference, i);
    const VectorXd gradient = weight * J.transpose() * error;
    const MatrixXd half = reference.sigma_px * weight * J.transpose();
    const MatrixXd information = weight * J.transpose() * J;
    Part& in_block = parts.blocks[static_cast<std::size_t>(block)];
    in_block.gradient += gradient;
    in_block.information += information;
    parts.tracks[point].gradient += gradient;
    parts.lasting += information;
    if (errors.share > 0.0)
      add_lasting(half, bundle.frames[frame].t_s, errors, memory[point], parts.lasting, in_block.information);
  }
  if (derivatives.rotations()) add_rotations(*derivatives.rotations(), block_of_frame, parts);
  return parts;
}

MatrixXd made_positive(const MatrixXd& symmetric) {
  const SymmetricEigen eigen = symmetric_eigen(symmetric);
  return eigen.vectors * eigen.values.cwiseMax(0.0).asDiagonal() * eigen.vectors.transpose();
}

/// Covariance shared along tracks beyond that of lasting errors, with the model whitened; `lasting`: of the scores.
MatrixXd track_excess(const Parts& parts, const MatrixXd& lasting, const MatrixXd& L, StatedCovariance& stated) {
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
  const MatrixXd by_track = L.transpose() * tracks * L, expected = L.transpose() * lasting * L;
  stated.track_effect = by_track.trace() / std::max(expected.trace(), 1e-12);
  stated.counts_tracks = stated.track_effect > 1.0 + 3.0 * std::sqrt(2.0 / (count - 1.0));
  return stated.counts_tracks ? MatrixXd(by_track - expected) : none;
}

/// Σ r(t)·r(t + lag) over the tracks, per lag; residuals beyond Huber's limit are shortened to it.
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
      product.resize(lag);  // no sum beyond the first lag without correlation
      break;
    }
  }
  return product;
}

/// τ [frames] for which Σ k exp(−k/τ) / Σ exp(−k/τ), k = 1 … last, equals `mean_lag`; independent of the share of the
/// noise that lasts. At most `last`: a longer correlation would not have ended there.
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

LastingErrors lasting_errors(const Adjustment& reference) {
  const std::vector<double> product = products_by_lag(reference);
  const auto num_frames = static_cast<double>(reference.bundle.frames.size());
  if (product.size() < 2 || !(product[0] > 0.0)) return {};
  // The bearing of a point absorbs the mean error of its track: all products lose the variance of that mean.
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
    constexpr double max_lost = 0.5;
    lost = std::min(of_mean / num_frames, max_lost);
  }
  if (!(sum > 0.0)) return {};
  const double frame_s = duration_of(reference) / std::max(1.0, num_frames - 1.0);
  const double tau = lasting_frames(lag_sum / sum, last);
  double kernel = 0.0;
  for (double k = 1.0; k <= last; k += 1.0) kernel += std::exp(-k / tau);
  return {tau * frame_s, std::min(sum / kernel, 1.0), lost};
}

StatedCovariance stated_covariance(const Adjustment& reference, const ObserveNuisances& nuisances) {
  StatedCovariance stated;
  const MatrixXd model = reference.solution.covariance();
  stated.cov = model;
  stated.inflation = VectorXd::Ones(model.rows());
  const double duration_s = duration_of(reference);
  if (!model.allFinite() || !(duration_s > 0.0)) return stated;
  stated.lasting = model;
  const LastingErrors errors = lasting_errors(reference);
  stated.correlation_s = errors.seconds;
  const double wanted = duration_s / std::max(correlations_a_block * stated.correlation_s, 1e-9);
  const int frames_allow = static_cast<int>(reference.bundle.frames.size() / 3);
  const int num_blocks = std::min(static_cast<int>(std::clamp<double>(wanted, min_blocks, max_blocks)), frames_allow);
  const Llt llt(model);
  if (num_blocks < 3 || !llt.is_positive()) return stated;
  stated.block_s = duration_s / num_blocks;
  const Parts parts = parts_of(reference, nuisances, num_blocks, errors);
  // Noise over that of the residuals: what the bearings absorb of white noise is already counted in the dof.
  const double counted = 1.0 / static_cast<double>(reference.bundle.frames.size());
  const double more = errors.share > 0.0 ? std::max(1.0, (1.0 - counted) / (1.0 - errors.lost)) : 1.0;
  const MatrixXd prior = reference.solution.prior_information;
  const auto with_scores = [&](const MatrixXd& scores) { return MatrixXd(model * (more * scores + prior) * model); };
  stated.lasting = model + made_positive(with_scores(parts.lasting) - model);
  MatrixXd within = MatrixXd::Zero(model.rows(), model.cols());
  for (const Part& part : parts.blocks) within += part.information;
  within = with_scores(within);
  within = model + made_positive(within - model);
  std::vector<ClusterStep> steps;
  for (const Part& part : parts.blocks) {
    steps.push_back({model * part.gradient, more * model * part.information * model});
  }
  stated.blocks = cluster_covariance(within, 1.0, steps);
  const MatrixXd L = llt.lower();
  stated.cov = stated.lasting + made_positive(stated.blocks.cov - within) +
               L * made_positive(track_excess(parts, more * parts.lasting, L, stated)) * L.transpose();
  stated.inflation = (stated.cov.diagonal().array() / model.diagonal().array()).sqrt();
  return stated;
}

}  // namespace alidade
