#pragma once

#include "alidade/files/files.h"
#include "alidade/formats/beam_file.h"
#include "alidade/formats/camera_file.h"
#include "alidade/formats/rig_file.h"
#include "alidade/images/photo_set.h"
#include "alidade/results/calibration_outcome.h"
#include "alidade/results/identify_outcome.h"
#include "alidade/results/project_outcome.h"
#include "alidade/results/save.h"
#include "alidade/results/servo_outcome.h"
#include "alidade/results/track_outcome.h"
#include "alidade/tables/corner_file.h"
#include "alidade/tables/events_file.h"
#include "alidade/tables/servo_log_file.h"
#include "alidade/tables/servo_scenario_file.h"

/// Files in and out: photos, cameras of OpenCV, ROS, Kalibr, mrcal, COLMAP and ours, rigs, tables.
