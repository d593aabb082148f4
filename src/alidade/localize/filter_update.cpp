#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "alidade/estimation/iterated_update.h"
#include "alidade/localize/filter.h"

namespace alidade {
namespace {

constexpr std::size_t most_singly = 12;  // used one by one, before the rest, whose pose is sure by then, in groups
constexpr std::size_t most_in_group = StateCovariance::max_columns / 2;

}  // namespace

void LocalizationFilter::expect(Measured& measured) const {
  measured.S = P_.innovation_covariance(measured.rows());
  measured.S.diagonal().array() += measured.variance_px2;
  measured.nis = measured.nu.dot(inverse_of_symmetric(measured.S) * measured.nu);
}

std::optional<ExpectedSight> LocalizationFilter::expected(long id) const {
  const Feature* feature = find(id);
  if (!feature) return std::nullopt;
  const auto view = expected_view(camera_, motion_.world_from_cam, *feature);
  if (!view) return std::nullopt;
  std::array<int, StateCovariance::max_support> columns{};
  std::array<double, StateCovariance::max_support> h0{}, h1{};
  std::size_t n = 0;
  const auto put = [&](int column, double d0, double d1) {
    columns[n] = column;
    h0[n] = d0;
    h1[n++] = d1;
  };
  for (int i = 0; i < 6; ++i) put(i, view->J_px_pose(0, i), view->J_px_pose(1, i));
  for (int k = 0; k < num_lens(); ++k) {
    const int index = config_.lens_params[static_cast<std::size_t>(k)];
    put(motion_dim + k, view->J_px_lens(0, index), view->J_px_lens(1, index));
  }
  for (int i = 0; i < feature->dim(); ++i) put(feature->offset + i, view->J_px_feature(0, i), view->J_px_feature(1, i));
  ExpectedSight sight{view->px, P_.innovation_covariance({{columns.data(), n}, h0.data(), h1.data()}), view->depth_m};
  sight.S.diagonal().array() += config_.sigma_px * config_.sigma_px;
  return sight;
}

void LocalizationFilter::collect(std::span<const FeatureSight> sights) {
  measured_.clear();
  outcomes_.assign(sights.size(), SightOutcome::not_in_map);
  nis_.assign(sights.size(), std::numeric_limits<double>::quiet_NaN());
  for (std::size_t i = 0; i < sights.size(); ++i) {
    const Feature* feature = find(sights[i].id);
    if (!feature || measured_.size() == static_cast<std::size_t>(config_.sights_capacity)) continue;
    const double sigma_px = sights[i].sigma_px > 0.0 ? sights[i].sigma_px : config_.sigma_px;
    Measured measured;
    measured.sight = i;
    measured.feature = feature;
    measured.px = sights[i].px;
    measured.variance_px2 = sigma_px * sigma_px;
    outcomes_[i] = SightOutcome::not_seen;
    if (!linearise(measured)) continue;
    measured_.push_back(measured);
  }
}

/// S⁻¹ of the whole group and what follows from it: the step in `next_`, L⁻ᵀ in `triangle_`.
bool LocalizationFilter::solve(std::span<Measured*> group) {
  std::array<StateCovariance::Rows, most_in_group> rows{};
  for (std::size_t m = 0; m < group.size(); ++m) rows[m] = group[m]->rows();
  P_.products({rows.data(), group.size()});
  const int num = 2 * static_cast<int>(group.size());
  SmallMatrix S = SmallMatrix::Zero(num, num);
  Eigen::Matrix<double, Eigen::Dynamic, 1, 0, StateCovariance::max_columns, 1> rhs(num);
  for (int a = 0; a < num; ++a) {
    const Measured& measured = *group[static_cast<std::size_t>(a / 2)];
    const auto& h = a % 2 ? measured.h1 : measured.h0;
    rhs[a] = measured.c[a % 2];
    for (std::size_t k = 0; k < static_cast<std::size_t>(measured.num_support); ++k) {
      const int column = measured.columns[k];
      rhs[a] -= h[k] * start_[column];
      for (int b = 0; b < num; ++b) S(a, b) += h[k] * P_.product_at(column, b);
    }
    S(a, a) += measured.variance_px2;
  }
  const Eigen::LLT<SmallMatrix> llt(S);
  if (llt.info() != Eigen::Success) return false;
  const auto weights = llt.solve(rhs).eval();
  group_nis_ = rhs.dot(weights);
  group_log_det_ = 0.0;
  for (int a = 0; a < num; ++a) group_log_det_ += 2.0 * std::log(llt.matrixLLT()(a, a));
  for (int i = 0; i < P_.dim(); ++i) {
    double sum = start_[i];
    for (int b = 0; b < num; ++b) sum += P_.product_at(i, b) * weights[b];
    next_[i] = sum;
  }
  triangle_ = SmallMatrix::Identity(num, num);
  llt.matrixU().solveInPlace(triangle_);
  return next_.head(P_.dim()).allFinite();
}

std::optional<double> LocalizationFilter::bend_of(const Measured& measured) {
  Measured there = measured;
  if (!linearise(there)) return std::nullopt;
  Eigen::Vector2d predicted = measured.c;
  for (std::size_t k = 0; k < static_cast<std::size_t>(measured.num_support); ++k)
    predicted -= delta_[measured.columns[k]] * Eigen::Vector2d(measured.h0[k], measured.h1[k]);
  return std::sqrt((there.nu - predicted).squaredNorm() / measured.variance_px2);
}

bool LocalizationFilter::take(std::span<Measured*> group) {
  const int dim = P_.dim();
  start_.head(dim) = delta_.head(dim);
  bool has_answer = false;
  for (int iteration = 0; iteration < config_.max_iterations; ++iteration) {
    if (!solve(group)) break;
    if (!has_answer && group.size() > 1) {  // what they share is counted once
      for (Measured* measured : group) measured->nis = group_nis_ / static_cast<double>(group.size());
    }
    has_answer = true;
    delta_.head(dim) = next_.head(dim);
    if (iteration + 1 == config_.max_iterations) break;
    double bend = 0.0;
    for (const Measured* measured : group) bend = std::max(bend, bend_of(*measured).value_or(0.0));
    if (bend < config_.bend_tolerance) break;
    for (Measured* measured : group) (void)linearise(*measured);
  }
  if (has_answer &&
      P_.append({triangle_.data(), static_cast<std::size_t>(triangle_.size())}, 2 * static_cast<int>(group.size()))) {
    for (Measured* measured : group) used_.push_back(measured);
    total_nis_ += group_nis_;
    total_log_det_ += group_log_det_;
    return true;
  }
  delta_.head(dim) = start_.head(dim);
  return false;
}

bool LocalizationFilter::use_again() {
  const int dim = P_.dim();
  P_.drop_pending();
  delta_.head(dim).setZero();
  total_nis_ = total_log_det_ = 0.0;
  for (std::size_t at = 0; at < used_.size(); at += most_in_group) {
    const std::span<Measured*> group(&used_[at], std::min(most_in_group, used_.size() - at));
    start_.head(dim) = delta_.head(dim);
    if (!solve(group) ||
        !P_.append({triangle_.data(), static_cast<std::size_t>(triangle_.size())}, 2 * static_cast<int>(group.size())))
      return false;
    delta_.head(dim) = next_.head(dim);
    total_nis_ += group_nis_;
    total_log_det_ += group_log_det_;
  }
  return true;
}

void LocalizationFilter::refine() {
  for (int iteration = 0; iteration < config_.max_iterations; ++iteration) {
    double bend = 0.0;
    for (const Measured* measured : used_) bend = std::max(bend, bend_of(*measured).value_or(0.0));
    if (bend < config_.bend_tolerance) return;
    for (Measured* measured : used_) (void)linearise(*measured);
    if (!use_again()) return;
  }
}

void LocalizationFilter::settle(Measured& measured, bool is_used) {
  outcomes_[measured.sight] = is_used ? SightOutcome::used : SightOutcome::gated;
  nis_[measured.sight] = measured.nis;
}

/// One by one, each at its own linearisation behind those before it: known points first, then by the size of what is
/// expected of the innovation. From the `most_singly`th on in groups.
void LocalizationFilter::use_in_order() {
  std::size_t num_used = 0;
  while (!waiting_.empty()) {
    for (Measured* measured : waiting_) {
      if (linearise(*measured))
        expect(*measured);
      else
        measured->nis = std::numeric_limits<double>::infinity();
    }
    std::ranges::sort(waiting_, [](const Measured* a, const Measured* b) {
      if (a->feature->is_known != b->feature->is_known) return b->feature->is_known;
      const double size_a = a->S.trace(), size_b = b->S.trace();
      return size_a != size_b ? size_a > size_b : a->sight > b->sight;
    });
    const std::size_t group_size = num_used < most_singly ? 1 : most_in_group;
    std::array<Measured*, most_in_group> group{};
    std::size_t num = 0;
    while (num < group_size && !waiting_.empty()) {
      Measured* next = waiting_.back();
      waiting_.pop_back();
      if (next->nis <= config_.gate)
        group[num++] = next;
      else
        settle(*next, false);
    }
    if (num == 0) continue;
    const bool is_used = take({group.data(), num});
    for (std::size_t i = 0; i < num; ++i) settle(*group[i], is_used);
    num_used += is_used ? num : 0;
  }
}

/// All at once, as far as a group goes.
void LocalizationFilter::use_together() {
  std::size_t num = 0;
  std::array<Measured*, most_in_group> group{};
  const auto use = [&] {
    if (num == 0) return;
    const bool is_used = take({group.data(), num});
    for (std::size_t i = 0; i < num; ++i) settle(*group[i], is_used);
    num = 0;
  };
  for (Measured* measured : waiting_) {
    const bool is_seen = linearise(*measured);
    if (is_seen) expect(*measured);
    if (!is_seen || !(measured->nis <= config_.gate)) {
      settle(*measured, false);
      continue;
    }
    group[num++] = measured;
    if (num == most_in_group) use();
  }
  use();
  waiting_.clear();
}

bool LocalizationFilter::finish_update() {
  if (!delta_.head(P_.dim()).allFinite() || !P_.stays_positive()) {
    P_.drop_pending();
    delta_.setZero();
    return false;
  }
  P_.commit();
  turns_world_ ? turn_by_delta() : move_by_delta();
  move_lens_by_delta();
  delta_.setZero();
  return true;
}

double LocalizationFilter::cost_of_used() const {
  std::size_t num_gated = 0;
  for (const Measured& measured : measured_) num_gated += outcomes_[measured.sight] == SightOutcome::gated ? 1 : 0;
  constexpr double log_two_pi = 1.8378770664093453;
  const double cost_gated = 2.0 * std::log(100.0 * 100.0) - 2.0 * std::log(0.1);
  return total_nis_ + total_log_det_ + 2.0 * static_cast<double>(used_.size()) * log_two_pi +
         static_cast<double>(num_gated) * cost_gated;
}

/// From the prior: which sights fit together, and what follows from them.
double LocalizationFilter::attempt(bool finds_consensus) {
  P_.drop_pending();
  delta_.setZero();
  waiting_.clear();
  doubtful_.clear();
  used_.clear();
  total_nis_ = total_log_det_ = 0.0;
  for (Measured& measured : measured_) {
    if (linearise(measured)) waiting_.push_back(&measured);
  }
  if (finds_consensus) keep_consensus();
  const auto use = [&] { config_.is_sequential ? use_in_order() : use_together(); };
  use();
  waiting_.swap(doubtful_);  // what disagreed before may agree with the updated state
  use();
  if (config_.is_sequential) refine();
  return cost_of_used();
}

void LocalizationFilter::keep_attempt() {
  kept_.outcomes = outcomes_;
  kept_.nis = nis_;
  kept_.used = used_;
  kept_.delta.head(P_.dim()) = delta_.head(P_.dim());
  kept_.total_nis = total_nis_;
  kept_.total_log_det = total_log_det_;
  P_.swap_pending();
}

void LocalizationFilter::restore_attempt() {
  outcomes_ = kept_.outcomes;
  nis_ = kept_.nis;
  used_ = kept_.used;
  delta_.head(P_.dim()) = kept_.delta.head(P_.dim());
  total_nis_ = kept_.total_nis;
  total_log_det_ = kept_.total_log_det;
  P_.swap_pending();
}

/// What fits together, with a consensus where sights disagree.
double LocalizationFilter::best_attempt() {
  double cost = attempt(false);
  constexpr std::size_t least_for_consensus = 4;
  const auto num_doubtful = static_cast<double>(measured_.size() - used_.size());
  const bool is_doubtful = num_doubtful > config_.consensus_above * static_cast<double>(measured_.size());
  if (config_.finds_consensus && is_doubtful && measured_.size() >= least_for_consensus) {
    keep_attempt();
    const double with_consensus = attempt(true);
    if (with_consensus < cost)
      cost = with_consensus;
    else
      restore_attempt();
  }
  return cost;
}

SightsReport LocalizationFilter::update(std::span<const FeatureSight> sights) {
  turns_world_ = config_.holds_frame;
  collect(sights);
  double cost = best_attempt();
  if (turns_world_ && !(delta_.segment<3>(3).norm() < config_.most_turn_rad)) {
    turns_world_ = false;
    cost = best_attempt();
  }
  SightsReport report{outcomes_, nis_};
  report.is_sound = finish_update();
  for (SightOutcome& outcome : outcomes_) {
    if (outcome == SightOutcome::used && !report.is_sound) outcome = SightOutcome::gated;
    if (outcome == SightOutcome::gated) ++report.num_gated;
    if (outcome == SightOutcome::used) ++report.num_used;
  }
  if (report.num_used > 0) report.nis_per_dof = total_nis_ / (2.0 * static_cast<double>(report.num_used));
  report.cost = cost;
  return report;
}

}  // namespace alidade
