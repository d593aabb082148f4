#pragma once

#include "alidade/reproduce/edge_scene.h"
#include "alidade/testing/rangefinder_sample.h"

namespace alidade::testing {

using reproduce::boxes;
using reproduce::cast;
using reproduce::edge_camera;
using reproduce::photo_of;
using reproduce::scan_of;

}  // namespace alidade::testing
