#pragma once

#include <functional>
#include <memory>
#include <string>

#include "alidade/calibrate/config.h"
#include "alidade/capture.h"
#include "cli/app/live.h"
#include "cli/app/run.h"

namespace alidade::cli {

/// Options of `calibrate --live` in addition to those of calibrate.
struct CaptureArgs {
  LiveOptions live;
  std::string from;  ///< A folder that fills, or a stream's address; empty: the browser's camera.
  bool no_page = false;
  std::string resume;
  double wait_s = 60.0;  ///< Without a page: so long nothing new may come before it ends.
  CaptureConfig config;
  bool until_is_given = false;
};

void add_capture_options(CLI::App& command, CaptureArgs& args);
[[nodiscard]] FieldList fields_of(CaptureArgs& args);

/// Photos that are taken one by one, guided, until the goal is reached; then `finish` calibrates from the folder of
/// those that were kept; `num_inexact` of them are not as the camera gave them. Throws UsageError for options that do
/// not go together.
[[nodiscard]] ExitCode calibrate_live(
    const Board& board, CaptureArgs args, Run& run,
    const std::function<ExitCode(const std::filesystem::path& photos, std::size_t num_inexact)>& finish);

/// Options of a capture without --live. Throws UsageError.
void require_no_capture(const CaptureArgs& args);

}  // namespace alidade::cli
