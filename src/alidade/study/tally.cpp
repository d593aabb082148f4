#include "alidade/study/tally.h"

#include <algorithm>
#include <limits>

namespace alidade {
namespace {

constexpr double largest = 0x1p15;  // its square is what a sum takes

bool can_be_summed(const TrialValue& value) {
  if (!value.has_value()) return true;
  return std::abs(value.error) < largest && value.sigma > 0.0 && value.sigma < largest && value.bound > 0.0 &&
         std::abs(value.error / value.bound) < largest;
}

bool is_worse(const WorstTrial& a, const WorstTrial& b) { return a.z() != b.z() ? a.z() > b.z() : a.trial < b.trial; }

constexpr int parts = 32;  // of a power of two

/// Whole numbers from a double's bits, which every machine does alike.
int size_of(double error) {
  constexpr int of_zero = -parts * 1100;
  int exponent = 0;
  const double mantissa = std::frexp(std::abs(error), &exponent);
  return mantissa == 0.0 ? of_zero : parts * exponent + static_cast<int>((mantissa - 0.5) * 2.0 * parts);
}

/// The size that a share of the errors is below, evenly spread within the part that it falls into.
double quantile_of(const QuantityTally& sums, double share) {
  const double wanted = share * static_cast<double>(sums.values);
  double below = 0.0;
  for (const auto& [size, count] : sums.sizes) {
    const auto here = static_cast<double>(count);
    if (below + here >= wanted) {
      const int part = ((size % parts) + parts) % parts;
      return std::ldexp(0.5 + (part + (wanted - below) / here) / (2.0 * parts), (size - part) / parts);
    }
    below += here;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

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
    if (!result.values[i].has_value()) continue;
    const auto& [error, sigma, bound] = result.values[i];
    QuantityTally& sums = quantities[i];
    ++sums.values;
    ++sums.sizes[size_of(error)];
    const double ratio = error / bound;
    sums.error.add(error);
    sums.error2.add(error * error);
    sums.sigma2.add(sigma * sigma);
    sums.ratio2.add(ratio * ratio);
    for (std::size_t k = 0; k < 3; ++k) sums.inside[k] += std::abs(error) < (static_cast<double>(k) + 1.0) * sigma;
    const WorstTrial here{trial, static_cast<int>(i), error, sigma};
    if (here.z() > furthest.z()) furthest = here;
  }
  good_beyond_5_sigma += result.state == State::good && furthest.z() > 5.0;
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
  good_beyond_5_sigma += other.good_beyond_5_sigma;
  for (std::size_t i = 0; i < states.size(); ++i) states[i] += other.states[i];
  for (std::size_t i = 0; i < quantities.size(); ++i) {
    QuantityTally& sums = quantities[i];
    const QuantityTally& more = other.quantities[i];
    sums.values += more.values;
    for (const auto& [size, count] : more.sizes) sums.sizes[size] += count;
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
  if (tally.estimates == 0 || tally.quantities[quantity].values == 0)
    return {none, none, none, none, none, none, {none, none, none}};
  const QuantityTally& sums = tally.quantities[quantity];
  const auto n = static_cast<double>(sums.values);
  QuantityFigures figures;
  figures.bias = sums.error.value() / n;
  figures.rms = std::sqrt(sums.error2.value() / n);
  figures.rms_sigma = std::sqrt(sums.sigma2.value() / n);
  figures.rms_over_bound = has_bound ? std::sqrt(sums.ratio2.value() / n) : figures.rms / figures.rms_sigma;
  figures.median = quantile_of(sums, 0.5);
  figures.p90 = quantile_of(sums, 0.9);
  for (std::size_t k = 0; k < 3; ++k) figures.coverage[k] = static_cast<double>(sums.inside[k]) / n;
  return figures;
}

}  // namespace alidade
