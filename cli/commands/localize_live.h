#pragma once

#include <filesystem>
#include <span>

#include "alidade/live/server.h"
#include "alidade/localize.h"
#include "alidade/tables/localize_file.h"
#include "cli/app/run.h"

namespace alidade::cli {

/// What `localize` answers frame by frame with. References: of the run.
struct FrameByFrame {
  const Camera& camera;
  const LocalizeConfig& config;
  std::span<const TimedPose> truth;
  bool is_up_to_scale;   ///< Its rows, whatever the end knows.
  live::Server* server;  ///< Null: nobody watches.
  const Progress& progress;
  Run& run;
};

/// Rows from standard input as they come, each frame answered as soon as it is complete with a row of poses.csv.
[[nodiscard]] Localization localize_input(const ObservationsOptions& reading, const FrameByFrame& given);

/// Images of a folder as another program writes them, each answered with a row of poses.csv. Ends where none has come
/// for `wait_s`.
[[nodiscard]] Localization localize_growing(const std::filesystem::path& folder, double rate_hz, double wait_s,
                                            const FrameByFrame& given);

}  // namespace alidade::cli
