#pragma once

#include "alidade/files/files.h"
#include "alidade/formats/camera_file.h"
#include "alidade/formats/rig_file.h"
#include "alidade/images/photo_set.h"
#include "alidade/results/calibration_outcome.h"
#include "alidade/results/moves_outcome.h"
#include "alidade/results/observation_result.h"
#include "alidade/results/observe_outcome.h"
#include "alidade/results/save.h"
#include "alidade/results/track_outcome.h"
#include "alidade/tables/corner_file.h"
#include "alidade/tables/events_file.h"
#include "alidade/tables/pairs_file.h"
#include "alidade/tables/rotation_log_file.h"

/// Files in and out: photos, cameras of OpenCV, ROS, Kalibr, mrcal, COLMAP and ours, rigs, tables of corners, events,
/// rotation logs, matches between photos.
