#pragma once

#include "alidade/io/camera_file.h"
#include "alidade/io/corner_file.h"
#include "alidade/io/files.h"
#include "alidade/io/photo_set.h"

/// Files in and out: photos, cameras of OpenCV, ROS, Kalibr, mrcal, COLMAP and ours, tables of corners.
