#pragma once

namespace alidade::cli {

class App;

// The commands of the group that have a file of their own; add_camera() adds them all.
void add_camera_diff(App& app);
void add_camera_undistort(App& app);

}  // namespace alidade::cli
