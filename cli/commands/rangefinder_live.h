#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "alidade/capture.h"
#include "cli/app/live.h"
#include "cli/app/run.h"

namespace alidade::cli {

/// Options of `rangefinder --live` in addition to those of rangefinder.
struct GuidedShotsArgs {
  LiveOptions live;
  std::string from, resume;
  double until_mm = 0.0;  ///< 3σ of the beam's origin; 0: the user ends it.
  ShotConfig where;
};

void add_guided_shots_options(CLI::App& command, GuidedShotsArgs& args);
[[nodiscard]] FieldList fields_of(GuidedShotsArgs& args);

/// Shots that are taken one by one, guided by a page: an image of the board and the reading that the user types;
/// then `finish` calibrates from the table of them. Throws UsageError for options that do not go together.
[[nodiscard]] ExitCode rangefinder_live(const Camera& camera, const RangefinderConfig& config, GuidedShotsArgs args,
                                        Run& run,
                                        const std::function<ExitCode(const std::filesystem::path& shots)>& finish);

/// Options of guided shots without --live. Throws UsageError.
void require_no_guided_shots(const GuidedShotsArgs& args);

}  // namespace alidade::cli
