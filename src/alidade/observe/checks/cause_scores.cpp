#include "alidade/observe/checks/cause_scores.h"

#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/observe/checks/cause_columns.h"
#include "alidade/observe/checks/stated_covariance.h"

namespace alidade {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t max_observations = 40000;  // thinned by frames: power falls, the test does not
constexpr int num_blocks = 12;
constexpr double estimated_effect = 1.5;
constexpr double min_given = 1e-10;  // of a cause's information that is its own: the rest is rounding

/// Score and information of a block of time, points eliminated: estimated parameters, then causes.
struct Block {
  VectorXd gradient;
  MatrixXd information;
};

class Linearisation {
 public:
  Linearisation(const RotationLog& log, const Adjustment& reference, const CauseConfig& config)
      : reference_(reference), columns_(log, reference, config), n_(columns_.layout().size), q_(columns_.size()) {
    const std::size_t count = reference.bundle.observations.size();
    every_ = static_cast<int>((count + max_observations - 1) / max_observations);
    eliminate_points();
    gather();
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

  void gather() {
    const Index size = n_ + q_;
    blocks_.assign(num_blocks, {VectorXd::Zero(size), MatrixXd::Zero(size, size)});
    const auto& frames = reference_.bundle.frames;
    const double from_s = frames.front().t_s, block_s = (frames.back().t_s - from_s) / num_blocks;
    seen_ = seen_within(block_s, lasting_errors(reference_).seconds);
    MatrixXd J(2, size);
    visit([&](std::size_t i, const BundleObservation& seen, const MatrixXd& by_causes) {
      const auto point = static_cast<std::size_t>(seen.point);
      J.leftCols(n_) =
          prediction_.J_px_common.leftCols(n_) + prediction_.J_px_point * reference_.solution.given_common[point].slope;
      J.rightCols(q_) = by_causes + prediction_.J_px_point * by_point_[point];
      const double elapsed_s = frames[static_cast<std::size_t>(seen.frame)].t_s - from_s;
      Block& block =
          blocks_[static_cast<std::size_t>(std::clamp(static_cast<int>(elapsed_s / block_s), 0, num_blocks - 1))];
      const double weight = residual_weight(reference_, i);
      block.gradient.noalias() += weight * J.transpose() * (prediction_.px - seen.px);
      block.information.selfadjointView<Eigen::Lower>().rankUpdate(J.transpose(), weight);
    });
    all_ = {VectorXd::Zero(size), MatrixXd::Zero(size, size)};
    for (Block& block : blocks_) {
      block.information = MatrixXd(block.information.selfadjointView<Eigen::Lower>());
      all_.gradient += block.gradient;
      all_.information += block.information;
    }
    all_.information.topLeftCorner(n_, n_) += reference_.solution.prior_information / every_;
    all_.gradient.head(n_) += reference_.solution.prior_gradient / every_;
    inverse_nn_ = inverse_symmetric(all_.information.topLeftCorner(n_, n_));
  }

  [[nodiscard]] CauseScore score_of(const CauseColumns::Group& group) const;

  const Adjustment& reference_;
  CauseColumns columns_;
  Index n_, q_;
  int every_ = 1;
  double seen_ = 1.0;               ///< Of the variance of sums, within blocks.
  std::vector<MatrixXd> by_point_;  ///< How each point follows the causes.
  std::vector<Block> blocks_;
  Block all_;
  MatrixXd inverse_nn_;
  RotationPrediction prediction_;
};

CauseScore Linearisation::score_of(const CauseColumns::Group& group) const {
  std::vector<Index> at;
  for (const int column : group.columns) at.push_back(n_ + column);
  const auto width = static_cast<Index>(at.size());
  MatrixXd cross(width, n_);
  for (Index i = 0; i < width; ++i) cross.row(i) = all_.information.row(at[static_cast<std::size_t>(i)]).head(n_);
  const MatrixXd follow = -inverse_nn_ * cross.transpose();  // n × width: estimated parameters a unit of each
  const MatrixXd whole = all_.information(at, at);
  const VectorXd unit = whole.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const MatrixXd S = unit.asDiagonal() * (whole + cross * follow) * unit.asDiagonal();
  const auto score = [&](const VectorXd& gradient) {
    return VectorXd(unit.asDiagonal() * (gradient(at) + follow.transpose() * gradient.head(n_)));
  };
  const SymmetricEigen eigen = symmetric_eigen(S);
  VectorXd inverse = VectorXd::Zero(width);
  for (Index i = 0; i < width; ++i) {
    if (eigen.values[i] > min_given) inverse[i] = 1.0 / eigen.values[i];
  }
  const MatrixXd S_inverse = eigen.vectors * inverse.asDiagonal() * eigen.vectors.transpose();
  const VectorXd s = score(all_.gradient);
  const VectorXd value = -(S_inverse * s);
  VectorXd step = VectorXd::Zero(n_ + q_);
  const VectorXd scaled = unit.asDiagonal() * value;
  step.head(n_) = follow * scaled;
  for (Index i = 0; i < width; ++i) step[at[static_cast<std::size_t>(i)]] = scaled[i];
  MatrixXd scatter = MatrixXd::Zero(width, width);
  for (const Block& block : blocks_) {
    const VectorXd left = score(block.gradient + block.information * step);
    scatter += left * left.transpose();
  }
  const double rank = std::max(1.0, static_cast<double>((inverse.array() > 0.0).count()));
  const double effect = std::max(1.0, (S_inverse * scatter).trace() / rank * num_blocks / (num_blocks - 1.0) / seen_);
  CauseScore result{.name = group.name, .shift = step.head(n_)};
  double chi2 = -s.dot(value) / effect;
  const double explained = chi2;
  if (effect > estimated_effect) {
    // A design effect estimated from few blocks is uncertain itself: of Hotelling's statistic, the χ² that is as rare.
    constexpr double dof = num_blocks - 1.0;
    chi2 = dof * std::log1p(std::max(chi2, 0.0) / dof);
  }
  // What it would take of the cause may be more than there ever is: a posterior, with a prior of ordinary sizes.
  VectorXd prior(width);
  for (Index i = 0; i < width; ++i) {
    const double ordinary = columns_.column(group.columns[static_cast<std::size_t>(i)]).ordinary;
    prior[i] = effect * unit[i] * unit[i] / (ordinary * ordinary * every_);
  }
  const double posterior = s.dot(inverse_symmetric(S + MatrixXd(prior.asDiagonal())) * s);
  const double likely = std::clamp(posterior / std::max(-s.dot(value), 1e-300), 0.0, 1.0);
  const double count = 2.0 * static_cast<double>(reference_.bundle.observations.size());
  result.z = rank > 1.0 ? std::sqrt(std::max(0.0, chi2 - 2.0 * (rank - 1.0))) : std::sqrt(std::max(0.0, chi2));
  result.gain = likely * explained - rank * std::log(count);
  const VectorXd whole_unit = unit.cwiseInverse();
  result.information = whole_unit.asDiagonal() * S * whole_unit.asDiagonal() * (every_ / effect);
  for (Index i = 0; i < width; ++i) {
    const CauseColumns::Column& column = columns_.column(group.columns[static_cast<std::size_t>(i)]);
    const double variance = S_inverse(i, i) * effect / every_;
    result.members.push_back({column.member, column.unit, scaled[i], unit[i] * std::sqrt(variance), follow.col(i)});
  }
  return result;
}

}  // namespace

std::vector<CauseScore> cause_scores(const RotationLog& log, const Adjustment& reference, const CauseConfig& config) {
  const RotationBundle& bundle = reference.bundle;
  if (bundle.frames.size() < 2 || bundle.frames.back().t_s <= bundle.frames.front().t_s) return {};
  if (reference.solution.given_common.size() != bundle.points.size()) return {};
  return Linearisation(log, reference, config).scores();
}

}  // namespace alidade
