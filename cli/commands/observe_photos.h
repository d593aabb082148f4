#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/turned/turned.h"
#include "cli/app/run.h"

namespace alidade::cli {

/// What `observe` is asked of photos of a camera that was turned by hand, or of matches between such photos.
struct TurnedArgs {
  std::vector<std::filesystem::path> photos;
  std::string pairs;  ///< A file of matches instead.
  bool skip_bad = false;
  int width_px = 0, height_px = 0;  ///< As told; 0: the photos', or what holds the matches.
  std::optional<Camera> lens;       ///< Of which the pixels are freed.
  TurnedConfig config;
};

/// Whether an argument is a photo or a folder of them, rather than a table.
[[nodiscard]] bool is_photo_argument(const std::string& argument);

[[nodiscard]] ExitCode observe_photos(TurnedArgs args, Run& run);

}  // namespace alidade::cli
