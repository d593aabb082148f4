#pragma once

#include "alidade/rangefinder/rangefinder.h"

namespace alidade {

/// A check built from all its members, in their order.
[[nodiscard]] inline Check check_of(std::string name, State state, std::string text, double value, double limit,
                                    std::string unit, std::string figure) {
  return {std::move(name), state, std::move(text), value, limit, std::move(unit), std::move(figure)};
}

/// Other possible causes, each tested on its own: scale and unit of the readings, the camera's focal length and centre,
/// a σ of spots that depends on distance, readings with a scatter that no rangefinder has.
void add_cause_checks(const RangefinderReport& report, std::span<const Shot> shots, const RangefinderConfig& config,
                      Verdict& verdict);

}  // namespace alidade
