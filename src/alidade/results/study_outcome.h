#pragma once

#include <span>
#include <string>
#include <vector>

#include "alidade/results/outcome.h"
#include "alidade/study/studies.h"
#include "alidade/study/study_plan.h"

namespace alidade {

/// Text of study.json: what depends on the study alone, and on no host, time, thread, rank or shard.
[[nodiscard]] std::string study_text(const StudyHeader& header, std::span<const StudyTally> points);

/// The document of a study, its printed lines, and study.json where all of its trials are there (`is_whole`; else
/// the shard that they are).
[[nodiscard]] JobOutcome outcome_of(const StudyHeader& header, std::span<const StudyTally> points,
                                    const Shard& shard = {});

/// One trial again, with all that the command of the estimator leaves: its report, and the files that it took.
[[nodiscard]] JobOutcome trial_outcome(const ObserveStudy& study, std::uint64_t seed, std::uint64_t trial);
[[nodiscard]] JobOutcome trial_outcome(const CalibrateStudy& study, std::uint64_t seed, std::uint64_t trial);
[[nodiscard]] JobOutcome trial_outcome(const RangefinderStudy& study, std::uint64_t seed, std::uint64_t trial);
[[nodiscard]] JobOutcome trial_outcome(const TrackStudy& study, std::uint64_t seed, std::uint64_t trial);
[[nodiscard]] JobOutcome trial_outcome(const LocalizeStudy& study, std::uint64_t seed, std::uint64_t trial);
[[nodiscard]] JobOutcome trial_outcome(const TurnedStudy& study, std::uint64_t seed, std::uint64_t trial);
[[nodiscard]] JobOutcome trial_outcome(const ChainStudy& study, std::uint64_t seed, std::uint64_t trial);

}  // namespace alidade
