#pragma once

#include <optional>
#include <span>
#include <string>

#include "alidade/track/track.h"

namespace alidade {

struct ClockShift;

/// The largest step of which all differences of capture times are multiples. 0: none of 0.1 ms or more, or too
/// few times. Images taken by all heads together at a constant rate have one, and so have rounded times:
/// the times themselves do not show which.
[[nodiscard]] double step_of_times(std::span<const TargetObservation> observations);

/// Whether times that are multiples of a step belong to images taken between the steps: their intervals alternate
/// between numbers of steps as with no camera that takes an image every so many steps, with or without gaps.
[[nodiscard]] bool are_between_steps(std::span<const double> times_s, double step_s);

/// Effect of rounding times to that step: how far the target moves within a step, and in σ of its position;
/// medians over the track.
struct StepMove {
  double step_s = 0.0, moved_m = 0.0, moved_in_sigma = 0.0;
};

/// None if the times have no common step, or if the target moves by less than half of σ in it.
[[nodiscard]] std::optional<StepMove> move_within_step(std::span<const TargetObservation> observations,
                                                       const TrackReport& report);

/// Effect on the target if the times of all heads are late by `late_s`.
[[nodiscard]] StepMove move_by_time(double late_s, const TrackReport& report);

/// None if the times of no head show that they were rounded, or --sigma-clock accounts for it.
[[nodiscard]] std::optional<RoundedTimes> rounded_times(std::span<const TargetObservation> observations,
                                                        const FollowConfig& config, const TrackReport& report);

/// The check "times": `care` if half a step moves the target by more than σ.
[[nodiscard]] Check rounded_check(const RoundedTimes& rounded);

/// Increases every covariance by the target's motion in half a step.
void count_rounding(double step_s, TrackReport& report);

/// "all t_capture_s are whole steps of 50 ms apart: …, which no observations show".
[[nodiscard]] std::string step_text(const StepMove& move);

/// The step, if a clock error of a head within that step explains the misfit: the shift, or a fault
/// that explains as much as the first one. Else 0.
[[nodiscard]] double step_that_explains(std::span<const TargetObservation> observations, const TrackReport& report,
                                        const std::optional<ClockShift>& shift);

/// "all times are whole steps of 50 ms apart: if they were rounded to that, …", and what to do.
[[nodiscard]] std::string rounding_text(double step_s);
[[nodiscard]] std::string rounding_remedy(double step_s);

/// The check "times" if they are not in seconds: rows are far apart, and in another unit the observations
/// are far more probable. None: they are in seconds.
[[nodiscard]] std::optional<Check> unit_of_times(std::span<const TargetObservation> observations,
                                                 std::span<const RigHead> heads, const FollowConfig& config);
/// The same for one head, if the times of the others are in seconds.
[[nodiscard]] std::optional<Check> units_of_heads_times(std::span<const TargetObservation> observations,
                                                        std::span<const RigHead> heads, const FollowConfig& config);
inline constexpr const char* unit_remedy = "give t_capture_s and t_arrival_s in seconds";

}  // namespace alidade
