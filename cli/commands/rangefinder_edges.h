#pragma once

#include <filesystem>

#include "cli/app/run.h"

namespace alidade::cli {

struct EdgesArgs {
  std::filesystem::path scan, camera, photo, start;
};

/// `rangefinder --method edges`: the direction of the beam without a target, from a scan of the head and a photo.
[[nodiscard]] ExitCode align_scan(const EdgesArgs& args, Run& run);

}  // namespace alidade::cli
