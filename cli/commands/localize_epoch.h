#pragma once

#include <cstdint>
#include <vector>

#include "alidade/localize/localization.h"
#include "alidade/results/outcome.h"

namespace alidade::cli {

/// Images in EuRoC's layout have times of an epoch, and the path those after the first of them, `origin_ns`; 0: it is
/// none. A truth of that epoch is read as one of the path's times.
void from_epoch(std::int64_t origin_ns, std::vector<TimedPose>& truth);
/// `trajectory.tum`, which other programs compare with files of the same recording, is written with the epoch's times.
void to_epoch(std::int64_t origin_ns, const Localization& result, JobOutcome& outcome);

}  // namespace alidade::cli
