#pragma once

#include "alidade/detect/image_sequence.h"
#include "alidade/files/files.h"
#include "alidade/formats/camera_file.h"
#include "alidade/images/photo_set.h"
#include "alidade/results/calibration_outcome.h"
#include "alidade/results/calibration_result.h"
#include "alidade/results/localize_outcome.h"
#include "alidade/results/photos_outcome.h"
#include "alidade/results/save.h"
#include "alidade/results/seen_frames.h"
#include "alidade/tables/corner_file.h"
#include "alidade/tables/localize_file.h"

/// Files in and out: photos, cameras of OpenCV, ROS, Kalibr, mrcal, COLMAP and ours, tables of corners.
