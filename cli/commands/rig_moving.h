#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cli/app/run.h"

namespace CLI {
class App;
}

namespace alidade::cli {

/// Options of `alidade rig --moving-target`.
struct MovingTargetArgs {
  bool is_asked = false;
  double clocks_s = 0.0;  ///< 0: one clock.
  std::string distance;   ///< "1:2:12.5" or "1:2:12.5:0.05"
  std::filesystem::path truth;
};
void add_moving_target_options(CLI::App& command, MovingTargetArgs& args);

/// Places cameras that do not turn by one target that moves. `cameras`: of all heads, or one a head.
ExitCode rig_by_moving_target(const std::filesystem::path& events, const std::vector<std::filesystem::path>& cameras,
                              const MovingTargetArgs& args, double sigma_px, bool skip_bad, Run& run);

}  // namespace alidade::cli
