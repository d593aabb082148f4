#pragma once

namespace alidade::cli {

class Frame;

// The commands of the group that have a file of their own; add_camera() adds them all.
void add_camera_diff(Frame& frame);
void add_camera_undistort(Frame& frame);

}  // namespace alidade::cli
