#pragma once

#include <optional>
#include <span>
#include <string>

#include "alidade/track/track.h"

namespace alidade {

struct ClockShift;

/// The largest step that all capture times are whole multiples of apart. 0: none of 0.1 ms or more, or too
/// few times. Images that all heads take together at a constant rate have one, and so have times that were rounded:
/// the times themselves do not tell which.
[[nodiscard]] double step_of_times(std::span<const TargetObservation> observations);

/// Whether times of images, whole steps apart, are of images that were taken between the steps: their intervals
/// alternate between numbers of steps as those of no camera that takes one every so many steps, with or without gaps.
[[nodiscard]] bool are_between_steps(std::span<const double> times_s, double step_s);

/// What times that were rounded to that step do to the target: how far it goes within a step, and in σ of its position;
/// medians over the track.
struct StepMove {
  double step_s = 0.0, moved_m = 0.0, moved_in_sigma = 0.0;
};

/// None where all times have no step, or where it moves the target by less than half of σ.
[[nodiscard]] std::optional<StepMove> move_within_step(std::span<const TargetObservation> observations,
                                                       const TrackReport& report);

/// What it does to the target if the times of all heads are late by so much.
[[nodiscard]] StepMove move_by_time(double late_s, const TrackReport& report);

/// None where the times of no head show that they were rounded, or --sigma-clock counts it.
[[nodiscard]] std::optional<RoundedTimes> rounded_times(std::span<const TargetObservation> observations,
                                                        const FollowConfig& config, const TrackReport& report);

/// The check of it, "times": of care where half a step moves the target by more than σ.
[[nodiscard]] Check rounded_check(const RoundedTimes& rounded);

/// Every covariance raised by what half a step moves the target.
void count_rounding(double step_s, TrackReport& report);

/// "all t_capture_s are whole steps of 50 ms apart: …, which no observations show".
[[nodiscard]] std::string step_text(const StepMove& move);

/// The step, if a clock of a head that is off by no more than that explains what does not fit: the shift, or a fault
/// that explains as much as the first one. Else 0.
[[nodiscard]] double step_that_explains(std::span<const TargetObservation> observations, const TrackReport& report,
                                        const std::optional<ClockShift>& shift);

/// "all times are whole steps of 50 ms apart: if they were rounded to that, …", and what to do.
[[nodiscard]] std::string rounding_text(double step_s);
[[nodiscard]] std::string rounding_remedy(double step_s);

/// The check "times" where they are in another unit than seconds: rows are far apart, and as that unit the observations
/// are far more probable. None: they are in seconds.
[[nodiscard]] std::optional<Check> unit_of_times(std::span<const TargetObservation> observations,
                                                 std::span<const RigHead> heads, const FollowConfig& config);
/// The same of one head, where the others' times are seconds.
[[nodiscard]] std::optional<Check> units_of_heads_times(std::span<const TargetObservation> observations,
                                                        std::span<const RigHead> heads, const FollowConfig& config);
inline constexpr const char* unit_remedy = "give t_capture_s and t_arrival_s in seconds";

}  // namespace alidade
