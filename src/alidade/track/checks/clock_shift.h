#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/track/track.h"

namespace alidade {

/// The head whose images were taken later or earlier than stated: a wrong clock looks like a manoeuvring target,
/// whose σ_a is then overestimated. Of two heads the second one, relative to the first: which of them is right is
/// unobservable.
struct ClockShift {
  std::size_t head = 0;
  double later_s = 0.0;  ///< To be added to its capture times.
  double gain = 0.0;     ///< Of ln p.
  std::string rival =
      {};  ///< The parameter of the rig whose error would explain the observations equally well; empty: none.
  double rival_off = 0.0, rival_gain = 0.0;

  [[nodiscard]] bool is_worse_than_rival() const {
    constexpr double clear = 3.0;  // of ln p
    return !rival.empty() && rival_gain > gain + clear;
  }
};

/// None if no shift of up to 0.1 s makes the observations far more probable, throughout the log, and lets them
/// fit. `rivals`: faults of the rig that might explain the same.
[[nodiscard]] std::optional<ClockShift> probable_clock_shift(std::span<const TargetObservation> observations,
                                                             std::span<const RigHead> heads, const FollowConfig& config,
                                                             std::span<const RigFault> rivals = {});

/// The observations in order of capture, those of one head shifted in time.
[[nodiscard]] std::vector<TargetObservation> with_shift(std::span<const TargetObservation> observations,
                                                        const ClockShift& shift);

}  // namespace alidade
