#pragma once

#include "alidade/io/calibration_outcome.h"
#include "alidade/io/camera_file.h"
#include "alidade/io/corner_file.h"
#include "alidade/io/files.h"
#include "alidade/io/photo_set.h"
#include "alidade/io/save.h"

/// Files in and out: photos, cameras of OpenCV, ROS, Kalibr, mrcal, COLMAP and ours, tables of corners.
