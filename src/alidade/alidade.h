#pragma once

/// Every public header: one for each room, and files.
#include "alidade/calibrate.h"
#include "alidade/capture.h"
#include "alidade/files.h"
#include "alidade/identify.h"
#include "alidade/localize.h"
#include "alidade/network.h"
#include "alidade/observe.h"
#include "alidade/project.h"
#include "alidade/rangefinder.h"
#include "alidade/rig.h"
#include "alidade/servo.h"
#include "alidade/track.h"
