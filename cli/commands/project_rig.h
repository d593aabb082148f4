#pragma once

#include <filesystem>
#include <vector>

#include "cli/app/run.h"

namespace alidade::cli {

/// `project --rig`: the projection matrices of a rig's heads at their angles, and where they see a point.
struct RigProjectionArgs {
  std::filesystem::path rig;
  std::vector<double> pans_rad, tilts_rad;  ///< One for all heads, or one for each.
  std::vector<double> point_m;              ///< Empty, or x, y, z in the world.
};
[[nodiscard]] ExitCode project_rig(const RigProjectionArgs& args, Run& run);

}  // namespace alidade::cli
