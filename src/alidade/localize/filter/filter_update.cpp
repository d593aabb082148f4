#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "alidade/estimation/iterated_update.h"
#include "alidade/localize/filter/filter.h"
#include "alidade/localize/filter/world_rotation.h"

namespace alidade {
namespace {

constexpr std::size_t max_singly = 12;  // processed one by one; the rest follows in groups, when the pose is well known

}  // namespace

void LocalizationFilter::expect(Measured& measured) const {
  measured.S = P_.innovation_covariance(measured.rows());
  measured.S.diagonal().array() += measured.variance_px2;
  measured.nis = measured.nu.dot(inverse_of_symmetric(measured.S) * measured.nu);
}

std::optional<ExpectedObservation> LocalizationFilter::expected(long id) const {
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
  ExpectedObservation observation{view->px, P_.innovation_covariance({{columns.data(), n}, h0.data(), h1.data()}),
                                  view->depth_m};
  observation.S.diagonal().array() += config_.sigma_px * config_.sigma_px;
  return observation;
}

void LocalizationFilter::collect(std::span<const FeatureObservation> observations) {
  measured_.clear();
  outcomes_.assign(observations.size(), ObservationOutcome::not_in_map);
  nis_.assign(observations.size(), std::numeric_limits<double>::quiet_NaN());
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const Feature* feature = find(observations[i].id);
    if (!feature || measured_.size() == static_cast<std::size_t>(config_.observations_capacity)) continue;
    const double sigma_px = observations[i].sigma_px > 0.0 ? observations[i].sigma_px : config_.sigma_px;
    Measured measured;
    measured.observation = i;
    measured.feature = feature;
    if (config_.holds_frame) measured.J_before = J_before_rotation(*feature);
    measured.px = observations[i].px;
    measured.variance_px2 = sigma_px * sigma_px;
    outcomes_[i] = ObservationOutcome::not_visible;
    if (!linearise(measured)) continue;
    measured_.push_back(measured);
  }
}

/// Solves with S of the whole group: the updated error in `next_`, L⁻ᵀ in `triangle_`.
bool LocalizationFilter::solve(std::span<Measured*> group) {
  std::array<StateCovariance::Rows, max_in_group> rows{};
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
      for (int b = 0; b <= a; ++b) S(a, b) += h[k] * P_.product_at(column, b);  // lower triangle only, for LLᵀ
    }
    S(a, a) += measured.variance_px2;
  }
  const Eigen::LLT<SmallMatrix> llt(S);
  if (llt.info() != Eigen::Success) return false;
  const auto weights = llt.solve(rhs).eval();
  group_nis_ = group_prior_ = rhs.dot(weights);
  for (int a = 0; a < num; ++a)
    group_prior_ -= group[static_cast<std::size_t>(a / 2)]->variance_px2 * weights[a] * weights[a];
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

double LocalizationFilter::bend_between(const Measured& here, const Measured& there) const {
  Eigen::Vector2d predicted = here.c;
  for (std::size_t k = 0; k < static_cast<std::size_t>(here.num_support); ++k)
    predicted -= delta_[here.columns[k]] * Eigen::Vector2d(here.h0[k], here.h1[k]);
  return std::sqrt((there.nu - predicted).squaredNorm() / here.variance_px2);
}

/// Moves delta_ to `next_`; with `must_fall`, only as far towards it as the cost decreases. The cost is the prior cost
/// of the step plus the residuals of the group; the group relinearised at the new delta_ is in `there_`. False, with
/// delta_ unchanged, if no such step exists.
bool LocalizationFilter::step(std::span<Measured*> group, bool must_fall, StepCost& at) {
  constexpr double min_share = 0.05, rounding = 1e-6;
  const int dim = P_.dim();
  before_.head(dim) = delta_.head(dim);
  for (double share = 1.0; share > min_share; share *= 0.5) {
    delta_.head(dim) = before_.head(dim) + share * (next_.head(dim) - before_.head(dim));
    const double prior = (1.0 - share) * at.prior + share * group_prior_;  // an upper bound: it is convex
    double all = prior;
    for (std::size_t m = 0; m < group.size(); ++m) {
      there_[m] = *group[m];
      const bool is_seen = linearise(there_[m]);
      all += is_seen ? there_[m].nu.squaredNorm() / there_[m].variance_px2 : std::numeric_limits<double>::infinity();
    }
    if (must_fall && !(all <= at.all + rounding * (1.0 + at.all))) continue;
    at = {prior, all};
    return true;
  }
  delta_.head(dim) = before_.head(dim);
  return false;
}

/// Gauss–Newton from `start_`: leaves the result in delta_ and returns its cost. Empty if no step could be made.
std::optional<double> LocalizationFilter::iterate(std::span<Measured*> group, bool must_fall) {
  StepCost at;
  for (const Measured* measured : group) at.all += measured->nu.squaredNorm() / measured->variance_px2;
  bool has_answer = false;
  constexpr int slower = 8;  // shortened steps converge more slowly
  const int max_iterations = (must_fall ? slower : 1) * config_.max_iterations;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    if (!solve(group)) break;
    if (!has_answer && group.size() > 1) {  // each gets an equal share: correlations are counted once
      for (Measured* measured : group) measured->nis = group_nis_ / static_cast<double>(group.size());
    }
    if (config_.max_iterations == 1) {  // plain EKF: no relinearisation
      delta_.head(P_.dim()) = next_.head(P_.dim());
      return group_nis_;
    }
    if (!step(group, must_fall, at)) break;
    has_answer = true;
    double curvature = 0.0;
    for (std::size_t m = 0; m < group.size(); ++m) curvature = std::max(curvature, bend_between(*group[m], there_[m]));
    if (curvature < config_.curvature_tolerance || iteration + 1 == max_iterations) break;
    for (std::size_t m = 0; m < group.size(); ++m) *group[m] = there_[m];
  }
  return has_answer ? std::optional(at.all) : std::nullopt;
}

bool LocalizationFilter::take(std::span<Measured*> group) {
  const int dim = P_.dim();
  start_.head(dim) = delta_.head(dim);
  // Full steps get across a strong curvature. From far away, beyond the edge of a strong lens, they can end anywhere:
  // then repeat with steps that must decrease the cost.
  auto cost = iterate(group, false);
  if (!(cost && *cost <= config_.gate * static_cast<double>(group.size()))) {
    delta_.head(dim) = start_.head(dim);
    for (Measured* measured : group) (void)linearise(*measured);
    cost = iterate(group, true);
  }
  if (cost &&
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
  for (std::size_t at = 0; at < used_.size(); at += max_in_group) {
    const std::span<Measured*> group(&used_[at], std::min(max_in_group, used_.size() - at));
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
    double curvature = 0.0;
    for (const Measured* measured : used_) {
      there_[0] = *measured;
      if (linearise(there_[0])) curvature = std::max(curvature, bend_between(*measured, there_[0]));
    }
    if (curvature < config_.curvature_tolerance) return;
    for (Measured* measured : used_) (void)linearise(*measured);
    if (!use_again()) return;
  }
}

void LocalizationFilter::settle(Measured& measured, bool is_used) {
  outcomes_[measured.observation] = is_used ? ObservationOutcome::used : ObservationOutcome::gated;
  nis_[measured.observation] = measured.nis;
}

/// One by one, each relinearised after those before it: known points first, then in ascending order of the predicted
/// innovation variance. After `max_singly` used ones in groups.
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
      return size_a != size_b ? size_a > size_b : a->observation > b->observation;
    });
    const std::size_t group_size = num_used < max_singly ? 1 : max_in_group;
    std::array<Measured*, max_in_group> group{};
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

/// All at once, in groups of the maximum size, in the given order.
void LocalizationFilter::use_together() {
  std::size_t num = 0;
  std::array<Measured*, max_in_group> group{};
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
    if (num == max_in_group) use();
  }
  use();
  waiting_.clear();
}

void LocalizationFilter::drop_update() {
  P_.drop_pending();
  delta_.setZero();
}

bool LocalizationFilter::finish_update() {
  if (!delta_.head(P_.dim()).allFinite() || !P_.stays_positive()) {
    drop_update();
    return false;
  }
  P_.commit();
  note_used();
  if (scale_at_) count_scale();
  end_scale();
  turns_world_ ? turn_by_delta() : move_by_delta();
  move_lens_by_delta();
  count_given();
  delta_.setZero();
  return true;
}

ObservationsReport LocalizationFilter::update(std::span<const FeatureObservation> observations) {
  turns_world_ = config_.holds_frame;
  if (config_.holds_frame) begin_scale();
  collect(observations);
  double cost = best_attempt();
  if (turns_world_ && !(delta_.segment<3>(3).norm() < config_.max_rotation_rad)) {
    turns_world_ = false;
    cost = best_attempt();
  }
  ObservationsReport report{outcomes_, nis_};
  // Each used observation was within the gate: the total NIS must not exceed the sum of the gates.
  const bool agrees = total_nis_ <= config_.gate * 2.0 * static_cast<double>(std::max<std::size_t>(1, used_.size()));
  if (!agrees) drop_update();
  report.is_sound = agrees && finish_update();
  end_scale();
  for (ObservationOutcome& outcome : outcomes_) {
    if (outcome == ObservationOutcome::used && !report.is_sound) outcome = ObservationOutcome::gated;
    if (outcome == ObservationOutcome::gated) ++report.num_gated;
    if (outcome == ObservationOutcome::used) ++report.num_used;
  }
  if (report.num_used > 0) report.nis_per_dof = total_nis_ / (2.0 * static_cast<double>(report.num_used));
  report.cost = cost;
  return report;
}

}  // namespace alidade
