#pragma once

#include <Eigen/LU>
#include <algorithm>

#include "alidade/reproduce/underwater_protocol.h"

namespace alidade::testing {

using reproduce::paper_filter;
using reproduce::point_error;
using reproduce::PointError;
using reproduce::ProtocolRun;
using reproduce::recommended_filter;
using reproduce::run_protocol;
using reproduce::underwater_sample;
using reproduce::UnderwaterSample;

}  // namespace alidade::testing
