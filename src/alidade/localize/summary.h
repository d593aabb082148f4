#pragma once

#include <functional>

#include "alidade/localize/localize.h"

namespace alidade {

/// Fills what a report says of the whole from its path and the filters at the end: counts, NIS, the map, the lens, and
/// with truth the error. `num_used`: how often a point of that id was used.
void sum_up(const FilterBank* bank, const std::function<std::size_t(long id)>& num_used,
            std::span<const TimedPose> truth, LocalizeReport& report);

}  // namespace alidade
