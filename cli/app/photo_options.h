#pragma once

#include <filesystem>
#include <vector>

#include "alidade/calibrate/calibration.h"
#include "alidade/images/photo_set.h"
#include "cli/app/run.h"

namespace CLI {
class App;
}

namespace alidade::cli {

/// The argument `photos`: files and folders.
void add_photos(CLI::App& command, std::vector<std::filesystem::path>& photos, bool is_required = false);

/// Throws InputError where none of the photos of a calibration could be read.
void require_readable(const PhotoSet& set, const Calibration& calibration);

/// What was read goes to the run's inputs; what lay beside the photos and their orientation, to what it says.
void tell_photos(const PhotoSet& set, Counts& counts, Verdict& verdict, Run& run);

}  // namespace alidade::cli
