#include "alidade/localize/path/path_doubt.h"

#include <numeric>

namespace alidade {
namespace {

constexpr std::size_t window = 5;

void push(std::deque<double>& recent, double value) {
  recent.push_back(value);
  if (recent.size() > window) recent.pop_front();
}

double mean(const std::deque<double>& recent) {
  return std::accumulate(recent.begin(), recent.end(), 0.0) / static_cast<double>(recent.size());
}

}  // namespace

double share(std::size_t part, std::size_t of) {
  return of > 0 ? static_cast<double>(part) / static_cast<double>(of) : 0.0;
}

Doubt PathDoubt::after(const PathStep& step) {
  const std::size_t num = step.num_tracked + step.num_gated;
  if (num == 0) return Doubt::none;
  constexpr double max_nis = 2.0, max_gated = 0.6;
  constexpr double max_known_gated = 0.85;  // with four known points, two mismatches prove nothing
  constexpr double many_known_gated = 0.3;
  push(recent_nis_, step.num_tracked > 0 ? step.nis_per_dof : max_nis);
  push(recent_gated_, share(step.num_gated, num));
  push(recent_known_gated_, share(step.num_known_gated, step.num_known));
  if (recent_nis_.size() < window) return Doubt::none;
  if (mean(recent_nis_) > max_nis) return Doubt::strong;
  if (mean(recent_gated_) > max_gated || mean(recent_known_gated_) > max_known_gated) return Doubt::many;
  return mean(recent_known_gated_) > many_known_gated ? Doubt::some : Doubt::none;
}

void PathDoubt::clear() {
  recent_nis_.clear();
  recent_gated_.clear();
  recent_known_gated_.clear();
}

}  // namespace alidade
