#pragma once

#include "alidade/rangefinder/rangefinder.h"

namespace alidade {

/// A check with all that it has, in the order of its members.
[[nodiscard]] inline Check check_of(std::string name, State state, std::string text, double value, double limit,
                                    std::string unit, std::string figure) {
  return {std::move(name), state, std::move(text), value, limit, std::move(unit), std::move(figure)};
}

/// What else could be wrong, each tested by itself: the scale of the readings and their unit, the camera's focal length
/// and centre, a σ of spots that depends on distance, readings that scatter as no rangefinder's do.
void add_cause_checks(const RangefinderReport& report, std::span<const Shot> shots, const RangefinderConfig& config,
                      Verdict& verdict);

}  // namespace alidade
