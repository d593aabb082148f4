#pragma once

/// Every public header: one for each room, and files.
#include "alidade/calibrate.h"
#include "alidade/files.h"
#include "alidade/localize.h"
