#include <algorithm>
#include <cmath>

#include "alidade/localize/filter/filter.h"

// Data association of one instant: several attempts from the same prior; the one that explains the observations best
// (lowest cost) is kept.

namespace alidade {

double LocalizationFilter::cost_of_used() const {
  std::size_t num_gated = 0;
  for (const Measured& measured : measured_)
    num_gated += outcomes_[measured.observation] == ObservationOutcome::gated ? 1u : 0u;
  constexpr double log_two_pi = 1.8378770664093453;
  const double cost_gated = 2.0 * std::log(100.0 * 100.0) - 2.0 * std::log(0.1);
  return total_nis_ + total_log_det_ + 2.0 * static_cast<double>(used_.size()) * log_two_pi +
         static_cast<double>(num_gated) * cost_gated;
}

/// One attempt from the prior: selects the observations that fit together and updates with them. Returns the cost.
double LocalizationFilter::attempt(Attempt way) {
  P_.drop_pending();
  delta_.setZero();
  waiting_.clear();
  doubtful_.clear();
  used_.clear();
  total_nis_ = total_log_det_ = 0.0;
  for (Measured& measured : measured_) {
    if (linearise(measured)) waiting_.push_back(&measured);
  }
  if (way == Attempt::by_consensus) keep_consensus();
  if (way == Attempt::jointly) use_first_jointly();
  const auto use = [&] { config_.is_sequential ? use_in_order() : use_together(); };
  use();
  waiting_.swap(doubtful_);  // those that disagreed before may agree with the updated state
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

/// Uses the first visible ones, as many as fit in a group, known points first, in one ungated step: three or four
/// observations alone can converge to the wrong one of several poses, from which the others look like outliers.
void LocalizationFilter::use_first_jointly() {
  const std::size_t num = std::min(waiting_.size(), max_in_group);
  if (num == 0) return;
  std::partition(waiting_.begin(), waiting_.end(),
                 [](const Measured* observation) { return observation->feature->is_known; });
  const bool is_used = take({waiting_.data(), num});
  for (std::size_t i = 0; i < num; ++i) settle(*waiting_[i], is_used);
  waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(num));
}

/// Makes another attempt and keeps it if it explains the observations better; returns the lower cost.
double LocalizationFilter::attempt_also(Attempt way, double cost) {
  keep_attempt();
  const double other = attempt(way);
  if (other < cost) return other;
  restore_attempt();
  return cost;
}

/// The best attempt; those with a consensus or a joint step are made only where observations disagree.
double LocalizationFilter::best_attempt() {
  double cost = attempt(Attempt::in_order);
  constexpr std::size_t min_for_another = 4;
  if (!config_.finds_consensus || measured_.size() < min_for_another) return cost;
  const auto share_left = [&] {
    return static_cast<double>(measured_.size() - used_.size()) / static_cast<double>(measured_.size());
  };
  if (share_left() > config_.consensus_above) cost = attempt_also(Attempt::by_consensus, cost);
  if (share_left() > 0.5) cost = attempt_also(Attempt::jointly, cost);
  return cost;
}

}  // namespace alidade
