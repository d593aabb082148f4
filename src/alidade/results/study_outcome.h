#pragma once

#include <span>
#include <string>
#include <vector>

#include "alidade/results/outcome.h"
#include "alidade/study/studies.h"
#include "alidade/study/study_plan.h"

namespace alidade {

/// Text of study.json: depends on the study only, not on host, time, thread, rank or shard.
[[nodiscard]] std::string study_text(const StudyHeader& header, std::span<const StudyTally> points);

/// Result document and printed lines of a study, and study.json if all of its trials are there (`is_whole`; otherwise
/// they are those of a shard).
[[nodiscard]] JobOutcome outcome_of(const StudyHeader& header, std::span<const StudyTally> points,
                                    const Shard& shard = {});

/// Repeats one trial, with everything that the estimator's command writes: its report, and the input files.
[[nodiscard]] JobOutcome trial_outcome(const ObserveStudy& study, std::uint64_t seed, std::uint64_t trial);
[[nodiscard]] JobOutcome trial_outcome(const CalibrateStudy& study, std::uint64_t seed, std::uint64_t trial);
[[nodiscard]] JobOutcome trial_outcome(const RangefinderStudy& study, std::uint64_t seed, std::uint64_t trial);
[[nodiscard]] JobOutcome trial_outcome(const TrackStudy& study, std::uint64_t seed, std::uint64_t trial);
[[nodiscard]] JobOutcome trial_outcome(const LocalizeStudy& study, std::uint64_t seed, std::uint64_t trial);
[[nodiscard]] JobOutcome trial_outcome(const TurnedStudy& study, std::uint64_t seed, std::uint64_t trial);
[[nodiscard]] JobOutcome trial_outcome(const ChainStudy& study, std::uint64_t seed, std::uint64_t trial);

}  // namespace alidade
