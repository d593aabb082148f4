#pragma once

#include "alidade/reproduce/track_trials.h"

namespace alidade::testing {

using reproduce::observations_of;
using reproduce::truth_of;

}  // namespace alidade::testing
