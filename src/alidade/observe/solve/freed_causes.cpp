#include "alidade/observe/solve/freed_causes.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "alidade/observe/solve/rotation_bundle.h"

namespace alidade {

bool is_answer(const ObserveSolution& report) { return report.status == ObserveSolution::Status::ok; }

bool free_cause(const std::string& cause, const RotationLog& log, ObserveSetup& config) {
  if (config.is_no_lever && cause == lever_cause) return false;
  const bool lens_is_given = config.lens_is_given;
  ObserveNuisances& estimate = config.nuisances;
  const ObserveNuisances before = estimate;
  const std::size_t errors_before = estimated_errors(log, config).size();
  config.estimate_errors.push_back(cause);
  if (estimated_errors(log, config).size() > errors_before) return true;
  config.estimate_errors.pop_back();
  std::istringstream names(cause);
  for (std::string name; std::getline(names, name, ',');) {
    const bool is_of_lens = name.size() == 2 && (name[0] == 'k' || name[0] == 'p');
    if (is_of_lens && lens_is_given) return false;
    if (const auto nuisance = nuisance_of(estimate_word_of(name))) estimate.*nuisance = true;
  }
  // No real lens has higher terms without the lower ones.
  estimate.k2 = estimate.k2 || (estimate.k3 && !lens_is_given);
  estimate.k1 = estimate.k1 || (estimate.k2 && !lens_is_given);
  return CommonLayout(estimate).size > CommonLayout(before).size;
}

const CauseScore* best_cause(const ObserveSolution& report, bool is_no_lever) {
  constexpr double nearly = 0.9;
  const CauseScore* best = nullptr;
  for (const CauseScore& cause : report.causes) {
    if (is_no_lever && cause.name == lever_cause) continue;
    if (cause.z >= asked_beyond(report) && (best == nullptr || cause.gain > best->gain)) best = &cause;
  }
  const CauseScore* simplest = best;
  for (const CauseScore& cause : report.causes) {
    if (is_no_lever && cause.name == lever_cause) continue;
    if (best == nullptr || cause.z < asked_beyond(report) || cause.gain < nearly * best->gain) continue;
    if (cause.members.size() < simplest->members.size()) simplest = &cause;
  }
  return simplest;
}

bool has_absurd_lever(const ObserveSolution& report) {
  constexpr double beyond = 3.0;  // σ that is assumed for heads
  const double most_m = beyond * CommonPrior(RotatingCamera()).sigma_lever_m;
  // With a real lever, no frames with common errors would remain.
  return report.jitter.noise_rad() > 0.0 &&
         std::ranges::any_of(report.quantities, [&](const ObservedQuantity& quantity) {
           return quantity.name.starts_with("lever_") && std::abs(quantity.value) > most_m;
         });
}

}  // namespace alidade
