#include "cli/app/photo_options.h"

#include <CLI/CLI.hpp>

#include "alidade/results/calibration_outcome.h"

namespace alidade::cli {

void add_photos(CLI::App& command, std::vector<std::filesystem::path>& photos, bool is_required) {
  command.add_option("photos", photos, "Photos of the board, or folders of photos (8- or 16-bit JPEG, PNG, TIFF)")
      ->required(is_required);
}

void require_readable(const PhotoSet& set, const Calibration& calibration) {
  set.require_readable(calibration.num_unreadable, calibration.views.empty() ? "" : calibration.views.front().reason);
}

void tell_photos(const PhotoSet& set, Counts& counts, Verdict& verdict, Run& run) {
  JobOutcome given;
  add_photos(set, given);
  ResultDocument& from = given.document;
  run.document.inputs.insert(run.document.inputs.end(), from.inputs.begin(), from.inputs.end());
  counts.skipped.insert(counts.skipped.end(), from.counts.skipped.begin(), from.counts.skipped.end());
  verdict.checks.insert(verdict.checks.end(), from.verdict.checks.begin(), from.verdict.checks.end());
  for (std::string& line : given.lines) run.say(std::move(line));
}

}  // namespace alidade::cli
