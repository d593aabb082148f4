#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "alidade/estimation/verdict.h"

namespace alidade {

/// One number that a study's trials estimate.
struct TrialQuantity {
  std::string name, unit;

  bool operator==(const TrialQuantity&) const = default;
};

/// What a trial found of a quantity: estimate − truth, the σ that the estimator states, and the Cramér–Rao bound's (of
/// a study without one: σ again).
struct TrialValue {
  double error = 0.0, sigma = 0.0, bound = 0.0;

  /// σ NaN: this estimate has none of the quantity.
  [[nodiscard]] bool has_value() const { return !std::isnan(sigma); }
};

struct TrialResult {
  State state = State::refused;
  bool has_estimate = false;
  std::vector<TrialValue> values;  ///< One per quantity, where there is an estimate.
};

/// Runs the trial of that number. What it is asked before changes nothing.
using RunTrial = std::function<void(std::uint64_t trial, TrialResult& result)>;

/// A simulated setting whose trials are drawn: what they estimate, and a worker for each thread.
struct StudySetting {
  std::vector<TrialQuantity> quantities;
  bool has_bound = false;  ///< The Cramér–Rao bound is known; otherwise σ is used instead.
  std::function<RunTrial()> make_worker;
};

}  // namespace alidade
