#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "alidade/beam/unit_direction.h"
#include "alidade/reproduce/beam_trials.h"
#include "alidade/reproduce/paper_report.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/example_camera.h"

namespace alidade::testing {

using reproduce::direction_error_rad;
using reproduce::draw_rangefinder_sample;
using reproduce::given_config;
using reproduce::origin_error_m;
using reproduce::quantile_of;
using reproduce::RangefinderSample;
using reproduce::reprojection_px;
using reproduce::solve_sample;

}  // namespace alidade::testing
