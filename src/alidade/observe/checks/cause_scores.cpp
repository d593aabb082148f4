#include "alidade/observe/checks/cause_scores.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "alidade/geometry/decompositions.h"
#include "alidade/observe/checks/cause_columns.h"
#include "alidade/observe/checks/eliminated_rotations.h"
#include "alidade/observe/checks/stated_covariance.h"
#include "alidade/observe/solve/gram_sum.h"

namespace alidade {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t max_observations = 40000;  // above it, frames are thinned: less power, same validity
constexpr int num_blocks = 12;
constexpr double estimated_effect = 1.5;
constexpr std::size_t min_tracks = 12;     // fewer do not reveal the errors that are shared along a track
constexpr double largest_of_tracks = 4.0;  // a tracker's errors; larger scatter has a cause and must not hide it
constexpr double min_given = 1e-10;        // eigenvalue of a cause's own share of information; smaller is rounding

/// Score and information of a block of time or of a track, points eliminated; order: estimated parameters, causes.
struct Block {
  VectorXd gradient;
  MatrixXd information;
};

/// Columns of a cause with the estimated parameters eliminated, scaled to unit information of their own.
struct ReducedCause {
  std::vector<Index> at;  ///< Indices in the whole system.
  MatrixXd follow;        ///< n × width: change of the estimated parameters per unit of each column.
  VectorXd unit;          ///< Scale per column.
  MatrixXd S, S_inverse;  ///< Information (Schur complement) and its pseudo-inverse.
  double rank = 1.0;      ///< Rank of S, at least 1.

  ReducedCause(const Block& all, const MatrixXd& inverse_nn, std::vector<Index> columns) : at(std::move(columns)) {
    MatrixXd cross(width(), inverse_nn.rows());
    for (Index i = 0; i < width(); ++i)
      cross.row(i) = all.information.row(at[static_cast<std::size_t>(i)]).head(inverse_nn.rows());
    follow = -inverse_nn * cross.transpose();
    const MatrixXd whole = all.information(at, at);
    unit = whole.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    S = unit.asDiagonal() * (whole + cross * follow) * unit.asDiagonal();
    const SymmetricEigen eigen = symmetric_eigen(S);
    VectorXd inverse = VectorXd::Zero(width());
    for (Index i = 0; i < width(); ++i)
      if (eigen.values[i] > min_given) inverse[i] = 1.0 / eigen.values[i];
    S_inverse = eigen.vectors * inverse.asDiagonal() * eigen.vectors.transpose();
    rank = std::max(1.0, static_cast<double>((inverse.array() > 0.0).count()));
  }

  [[nodiscard]] Index width() const { return static_cast<Index>(at.size()); }
  [[nodiscard]] VectorXd score(const VectorXd& gradient) const {
    return unit.asDiagonal() * (gradient(at) + follow.transpose() * gradient.head(follow.rows()));
  }
  /// Step of all parameters for a step of the cause.
  [[nodiscard]] VectorXd step(const VectorXd& of_cause, Index size) const {
    VectorXd all = VectorXd::Zero(size);
    all.head(follow.rows()) = follow * of_cause;
    for (Index i = 0; i < width(); ++i) all[at[static_cast<std::size_t>(i)]] = of_cause[i];
    return all;
  }
};

/// Variance of the scores over that for independent observations, and the number of clusters it was estimated from.
struct DesignEffect {
  double value = 1.0, clusters = num_blocks;
};

/// A design effect estimated from few clusters is itself uncertain: the χ² that is as improbable as Hotelling's T².
double as_rare_chi2(double chi2, const DesignEffect& effect) {
  const double dof = effect.clusters - 1.0;
  return effect.value > estimated_effect ? dof * std::log1p(std::max(chi2, 0.0) / dof) : chi2;
}

class Linearisation {
 public:
  Linearisation(const RotationLog& log, const Adjustment& reference, const CauseConfig& config)
      : reference_(reference), columns_(log, reference, config), n_(columns_.layout().size), q_(columns_.size()) {
    const std::size_t count = reference.bundle.observations.size();
    const bool is_rotated = has_rotations(reference.solution);  // has few frames: not thinned
    if (!is_rotated) every_ = static_cast<int>((count + max_observations - 1) / max_observations);
    is_rotated ? eliminate_rotations() : eliminate_points();
    gather();
    if (is_rotated) leave_out_absorbed();
    inverse_nn_ = inverse_symmetric(all_.information.topLeftCorner(n_, n_));
  }

  std::vector<CauseScore> scores() const {
    std::vector<CauseScore> scores;
    for (const CauseColumns::Group& group : columns_.groups()) scores.push_back(score_of(group));
    return scores;
  }

 private:
  template <typename Visit>
  void visit(const Visit& visit_one) {
    int frame = -1;
    const auto& observations = reference_.bundle.observations;
    MatrixXd by_causes(2, q_);
    for (std::size_t i = 0; i < observations.size(); ++i) {
      const BundleObservation& seen = observations[i];
      if (seen.frame % every_ != 0) continue;
      if (seen.frame != frame) columns_.begin_frame(frame = seen.frame);
      if (columns_.at(seen, prediction_, by_causes)) visit_one(i, seen, by_causes);
    }
  }

  void eliminate_points() {
    by_point_.assign(reference_.bundle.points.size(), MatrixXd::Zero(3, q_));
    visit([&](std::size_t i, const BundleObservation& seen, const MatrixXd& by_causes) {
      by_point_[static_cast<std::size_t>(seen.point)].noalias() +=
          residual_weight(reference_, i) * every_ * prediction_.J_px_point.transpose() * by_causes;
    });
    for (std::size_t k = 0; k < by_point_.size(); ++k) {
      by_point_[k] = -(reference_.solution.given_common[k].cov * by_point_[k]).eval();
    }
  }

  [[nodiscard]] MatrixXd columns_of(const MatrixXd& by_causes) const {
    MatrixXd J(2, n_ + q_);
    J << prediction_.J_px_common.leftCols(n_), by_causes;
    return J;
  }

  void eliminate_rotations() {
    rotations_.emplace(reference_, n_ + q_);
    visit([&](std::size_t i, const BundleObservation& seen, const MatrixXd& by_causes) {
      rotations_->add(seen, residual_weight(reference_, i), columns_of(by_causes), columns_.by_rotation(),
                      prediction_.J_px_point);
    });
    rotations_->solve();
  }

  /// Derivatives by estimated parameters and causes, with points and rotations eliminated.
  [[nodiscard]] MatrixXd followed(const BundleObservation& seen, const MatrixXd& by_causes) const {
    MatrixXd J = columns_of(by_causes);
    if (rotations_) return rotations_->followed(seen, J, columns_.by_rotation(), prediction_.J_px_point);
    const auto point = static_cast<std::size_t>(seen.point);
    J.leftCols(n_) += prediction_.J_px_point * reference_.solution.given_common[point].slope;
    J.rightCols(q_) += prediction_.J_px_point * by_point_[point];
    return J;
  }

  [[nodiscard]] Block& block_of(int frame) {
    const auto& frames = reference_.bundle.frames;
    const double from_s = frames.front().t_s, block_s = (frames.back().t_s - from_s) / num_blocks;
    const double elapsed_s = frames[static_cast<std::size_t>(frame)].t_s - from_s;
    return blocks_[static_cast<std::size_t>(std::clamp(static_cast<int>(elapsed_s / block_s), 0, num_blocks - 1))];
  }

  /// Mount and delay cannot be distinguished from rotations that are not measured: such columns are set to zero.
  void leave_out_absorbed() {
    for (Index i = n_; i < n_ + q_; ++i) {
      if (!rotations_->is_absorbed(i, all_.information(i, i))) continue;
      const auto leave_out = [i](Block& block) {
        block.gradient[i] = 0.0;
        block.information.row(i).setZero();
        block.information.col(i).setZero();
      };
      for (Block& block : blocks_) leave_out(block);
      leave_out(all_);
    }
  }

  void gather() {
    const Index size = n_ + q_;
    blocks_.assign(num_blocks, {VectorXd::Zero(size), MatrixXd::Zero(size, size)});
    const std::size_t num_points = reference_.bundle.points.size();
    if (num_points >= min_tracks) by_track_.assign(num_points, {VectorXd::Zero(n_), MatrixXd::Zero(n_, size)});
    const auto& frames = reference_.bundle.frames;
    const double block_s = (frames.back().t_s - frames.front().t_s) / num_blocks;
    seen_ = seen_within(block_s, lasting_errors(reference_).seconds);
    GramSum gram;
    visit([&](std::size_t i, const BundleObservation& seen, const MatrixXd& by_causes) {
      const MatrixXd J = followed(seen, by_causes);
      Block& block = block_of(seen.frame);
      const double weight = residual_weight(reference_, i);
      const Eigen::Matrix<double, Eigen::Dynamic, 2> weighted = weight * J.transpose();
      const VectorXd pull = weighted * (prediction_.px - seen.px);
      block.gradient += pull;
      gram.add(J, weight, block.information);
      if (by_track_.empty()) return;
      Block& track = by_track_[static_cast<std::size_t>(seen.point)];
      track.gradient.head(n_) += pull.head(n_);
      track.information.topRows(n_).noalias() += weighted.topRows(n_).lazyProduct(J.topRows<2>());
    });
    gram.flush();
    for (int k = 0; rotations_ && k < static_cast<int>(frames.size()); ++k)
      rotations_->add_prior(k, block_of(k).gradient, block_of(k).information);
    all_ = {VectorXd::Zero(size), MatrixXd::Zero(size, size)};
    for (Block& block : blocks_) {
      block.information = MatrixXd(block.information.selfadjointView<Eigen::Lower>());
      all_.gradient += block.gradient;
      all_.information += block.information;
    }
    all_.information.topLeftCorner(n_, n_) += reference_.solution.prior_information / every_;
    all_.gradient.head(n_) += reference_.solution.prior_gradient / every_;
  }

  [[nodiscard]] DesignEffect design_effect(const ReducedCause& cause, const VectorXd& step) const;
  [[nodiscard]] DesignEffect effect_of_tracks(const VectorXd& step) const;
  [[nodiscard]] double likely_share(const CauseColumns::Group& group, const ReducedCause& cause, const VectorXd& score,
                                    double explained, double effect) const;
  [[nodiscard]] CauseScore score_of(const CauseColumns::Group& group) const;

  const Adjustment& reference_;
  CauseColumns columns_;
  Index n_, q_;
  int every_ = 1;
  double seen_ = 1.0;                             ///< Share of a sum's variance that is seen within blocks.
  std::vector<MatrixXd> by_point_;                ///< Change of each point per unit of the causes; if rotations are
  std::optional<EliminatedRotations> rotations_;  ///< estimated, this eliminates them and the points instead.
  std::vector<Block> blocks_, by_track_;          ///< `by_track_` has only the rows of the estimated parameters.
  Block all_;
  MatrixXd inverse_nn_;
  RotationPrediction prediction_;
};

/// Scatter of the score between blocks of time over that of independent observations; that between tracks if larger.
DesignEffect Linearisation::design_effect(const ReducedCause& cause, const VectorXd& step) const {
  MatrixXd scatter = MatrixXd::Zero(cause.width(), cause.width());
  for (const Block& block : blocks_) {
    const VectorXd left = cause.score(block.gradient + block.information * step);
    scatter += left * left.transpose();
  }
  const double by_blocks = (cause.S_inverse * scatter).trace() / cause.rank * num_blocks / (num_blocks - 1.0) / seen_;
  const DesignEffect by_tracks = effect_of_tracks(step);
  return by_tracks.value > by_blocks ? by_tracks : DesignEffect{std::max(1.0, by_blocks)};
}

/// The same between tracks, in the directions of the estimated parameters: a cause may have one parameter per point,
/// which absorbs all errors that are shared along its track.
DesignEffect Linearisation::effect_of_tracks(const VectorXd& step) const {
  if (by_track_.empty()) return {};
  MatrixXd scatter = MatrixXd::Zero(n_, n_);
  for (const Block& track : by_track_) {
    const VectorXd left = track.gradient + track.information * step;
    scatter += left * left.transpose();
  }
  const double count = static_cast<double>(by_track_.size());
  const double effect = (inverse_nn_ * scatter).trace() / static_cast<double>(n_) * count / (count - 1.0);
  const double by_chance = 1.0 + 3.0 * std::sqrt(2.0 / (count - 1.0));
  return effect > by_chance ? DesignEffect{std::min(effect, largest_of_tracks), count} : DesignEffect{};
}

/// The value that the score asks for may be larger than is plausible: posterior with a prior of typical sizes. Returns
/// the share of the maximum of the likelihood, `explained`, that remains.
double Linearisation::likely_share(const CauseColumns::Group& group, const ReducedCause& cause, const VectorXd& score,
                                   double explained, double effect) const {
  VectorXd prior(cause.width());
  for (Index i = 0; i < cause.width(); ++i) {
    const double ordinary = columns_.column(group.columns[static_cast<std::size_t>(i)]).ordinary;
    prior[i] = effect * cause.unit[i] * cause.unit[i] / (ordinary * ordinary * every_);
  }
  const double posterior = score.dot(inverse_symmetric(cause.S + MatrixXd(prior.asDiagonal())) * score);
  return std::clamp(posterior / std::max(explained, 1e-300), 0.0, 1.0);
}

CauseScore Linearisation::score_of(const CauseColumns::Group& group) const {
  std::vector<Index> at;
  for (const int column : group.columns) at.push_back(n_ + column);
  const ReducedCause cause(all_, inverse_nn_, std::move(at));
  const VectorXd s = cause.score(all_.gradient), value = -(cause.S_inverse * s);
  const VectorXd scaled = cause.unit.asDiagonal() * value, step = cause.step(scaled, n_ + q_);
  const DesignEffect shared = design_effect(cause, step);
  const double effect = shared.value, likelihood = -s.dot(value), explained = likelihood / effect;
  const double chi2 = std::max(0.0, as_rare_chi2(explained, shared));
  const double count = 2.0 * static_cast<double>(reference_.bundle.observations.size());
  CauseScore result{.name = group.name, .shift = step.head(n_), .from_s = group.from_s};
  result.z = std::sqrt(cause.rank > 1.0 ? std::max(0.0, chi2 - 2.0 * (cause.rank - 1.0)) : chi2);
  result.gain = likely_share(group, cause, s, likelihood, effect) * explained - cause.rank * std::log(count);
  const VectorXd whole_unit = cause.unit.cwiseInverse();
  result.information = whole_unit.asDiagonal() * cause.S * whole_unit.asDiagonal() * (every_ / effect);
  for (Index i = 0; i < cause.width(); ++i) {
    const CauseColumns::Column& column = columns_.column(group.columns[static_cast<std::size_t>(i)]);
    const double variance = cause.S_inverse(i, i) * effect / every_;
    result.members.push_back(
        {column.member, column.unit, scaled[i], cause.unit[i] * std::sqrt(variance), cause.follow.col(i)});
  }
  return result;
}

/// Keeps only that step of the mounting which explains most.
void keep_best_step(std::vector<CauseScore>& scores) {
  const auto is_step = [](const CauseScore& score) { return score.name == step_cause; };
  const CauseScore* best = nullptr;
  for (const CauseScore& score : scores)
    if (is_step(score) && (best == nullptr || score.gain > best->gain)) best = &score;
  if (best == nullptr) return;
  const double from_s = best->from_s;
  std::erase_if(scores, [&](const CauseScore& score) { return is_step(score) && score.from_s != from_s; });
}

}  // namespace

std::vector<CauseScore> cause_scores(const RotationLog& log, const Adjustment& reference, const CauseConfig& config) {
  constexpr int num_steps = 8, num_closer = 16;
  constexpr double asked = 5.0;
  const std::vector<RotationFrame>& frames = reference.bundle.frames;
  if (frames.size() < 2 || frames.back().t_s <= frames.front().t_s) return {};
  const double apart_s = (frames.back().t_s - frames.front().t_s) / num_steps;
  CauseConfig with_steps = config;
  for (int k = 1; k < num_steps; ++k) with_steps.steps_s.push_back(frames.front().t_s + k * apart_s);
  std::vector<CauseScore> scores = Linearisation(log, reference, with_steps).scores();
  keep_best_step(scores);
  const auto step = std::ranges::find(scores, std::string(step_cause), &CauseScore::name);
  if (step == scores.end() || step->z < asked) return scores;
  // Refines the instant of the step.
  with_steps.steps_s.clear();
  for (int k = 0; k <= num_closer; ++k)
    with_steps.steps_s.push_back(step->from_s + (2.0 * k / num_closer - 1.0) * apart_s);
  scores = Linearisation(log, reference, with_steps).scores();
  keep_best_step(scores);
  return scores;
}

}  // namespace alidade
