#include "alidade/study/tally.h"

#include <algorithm>
#include <limits>

namespace alidade {
namespace {

constexpr double largest = 0x1p15;  // its square is what a sum takes

bool can_be_summed(const TrialValue& value) {
  return std::abs(value.error) < largest && value.sigma > 0.0 && value.sigma < largest && value.bound > 0.0 &&
         std::abs(value.error / value.bound) < largest;
}

bool is_worse(const WorstTrial& a, const WorstTrial& b) { return a.z() != b.z() ? a.z() > b.z() : a.trial < b.trial; }

}  // namespace

void StudyTally::add(std::uint64_t trial, const TrialResult& result) {
  ++trials;
  ++states[static_cast<std::size_t>(result.state)];
  if (!result.has_estimate) return;
  if (!std::ranges::all_of(result.values, can_be_summed)) {
    ++beyond;
    return;
  }
  ++estimates;
  WorstTrial furthest{trial, 0, 0.0, 1.0};
  for (std::size_t i = 0; i < quantities.size(); ++i) {
    const auto& [error, sigma, bound] = result.values[i];
    QuantityTally& sums = quantities[i];
    const double ratio = error / bound;
    sums.error.add(error);
    sums.error2.add(error * error);
    sums.sigma2.add(sigma * sigma);
    sums.ratio2.add(ratio * ratio);
    for (std::size_t k = 0; k < 3; ++k) sums.inside[k] += std::abs(error) < (static_cast<double>(k) + 1.0) * sigma;
    const WorstTrial here{trial, static_cast<int>(i), error, sigma};
    if (here.z() > furthest.z()) furthest = here;
  }
  note(furthest);
}

void StudyTally::note(const WorstTrial& trial) {
  if (worst.size() == max_worst && !is_worse(trial, worst.back())) return;
  worst.insert(std::ranges::upper_bound(worst, trial, is_worse), trial);
  if (worst.size() > max_worst) worst.pop_back();
}

void StudyTally::add(const StudyTally& other) {
  if (quantities.empty()) quantities.resize(other.quantities.size());
  trials += other.trials;
  estimates += other.estimates;
  beyond += other.beyond;
  for (std::size_t i = 0; i < states.size(); ++i) states[i] += other.states[i];
  for (std::size_t i = 0; i < quantities.size(); ++i) {
    QuantityTally& sums = quantities[i];
    const QuantityTally& more = other.quantities[i];
    sums.error.add(more.error);
    sums.error2.add(more.error2);
    sums.sigma2.add(more.sigma2);
    sums.ratio2.add(more.ratio2);
    for (std::size_t k = 0; k < 3; ++k) sums.inside[k] += more.inside[k];
  }
  for (const WorstTrial& trial : other.worst) note(trial);
}

QuantityFigures figures_of(const StudyTally& tally, std::size_t quantity, bool has_bound) {
  constexpr double none = std::numeric_limits<double>::quiet_NaN();
  if (tally.estimates == 0) return {none, none, none, none, {none, none, none}};
  const QuantityTally& sums = tally.quantities[quantity];
  const auto n = static_cast<double>(tally.estimates);
  QuantityFigures figures;
  figures.bias = sums.error.value() / n;
  figures.rms = std::sqrt(sums.error2.value() / n);
  figures.rms_sigma = std::sqrt(sums.sigma2.value() / n);
  figures.rms_over_bound = has_bound ? std::sqrt(sums.ratio2.value() / n) : figures.rms / figures.rms_sigma;
  for (std::size_t k = 0; k < 3; ++k) figures.coverage[k] = static_cast<double>(sums.inside[k]) / n;
  return figures;
}

}  // namespace alidade
