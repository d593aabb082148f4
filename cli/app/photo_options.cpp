#include "cli/app/photo_options.h"

#include <CLI/CLI.hpp>

namespace alidade::cli {

void add_photos(CLI::App& command, std::vector<std::filesystem::path>& photos, bool is_required) {
  command.add_option("photos", photos, "Photos of the board, or folders of them (8- or 16-bit JPEG, PNG, TIFF)")
      ->required(is_required);
}

void require_readable(const PhotoSet& set, const Calibration& calibration) {
  set.require_readable(calibration.num_unreadable, calibration.views.empty() ? "" : calibration.views.front().reason);
}

void tell_photos(const PhotoSet& set, Counts& counts, Verdict& verdict, Run& run) {
  for (InputFile& input : set.inputs()) run.document.inputs.push_back(std::move(input));
  counts.skipped.insert(counts.skipped.end(), set.skipped().begin(), set.skipped().end());
  if (const std::string line = set.skipped_line(); !line.empty()) run.say(line);
  if (const auto turned = set.turned()) {
    run.say(turned->text);
    verdict.checks.push_back(*turned);
  }
}

}  // namespace alidade::cli
