#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "alidade/board/board_fields.h"
#include "alidade/calibrate/found_corners.h"
#include "alidade/results/calibration_outcome.h"
#include "cli/app/app.h"
#include "cli/app/board_options.h"
#include "cli/app/photo_options.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct CornersArgs {
  std::vector<std::filesystem::path> photos;
  Board board = no_board();
  CalibrateConfig config;
  bool csv = false;
};

FieldList fields_of(CornersArgs& args) {
  FieldList fields = alidade::fields_of(args.board);
  for (Field& field : alidade::fields_of(args.config)) {
    if (field.name == "model" || field.name == "outliers") fields.push_back(std::move(field));
  }
  fields.push_back({.name = "csv", .value = &args.csv, .help = "Print corners.csv on stdout, nothing else"});
  return fields;
}

/// With --csv the table is all that stdout gets; the folder gets the rest as always.
ExitCode run_corners(CornersArgs args, Run& run) {
  if (args.csv && run.options.json) throw UsageError("--csv and --json both want stdout");
  if (args.csv) run.print_file("corners.csv");
  require_board(args.board);
  const PhotoSet set(args.photos);
  const FoundCorners found = find_corners(set.photos(), args.board, args.config, run.progress);
  run.lap("solve");
  require_readable(set, found.calibration);
  JobOutcome outcome = outcome_of(found);
  add_photos(set, outcome);
  return run.finish(std::move(outcome));
}

}  // namespace

void add_corners(App& app) {
  auto args = std::make_shared<CornersArgs>();
  CLI::App& command = app.add_command(
      {.name = "corners",
       .summary = "Detect board corners in photos, each with its full covariance",
       .examples = "alidade corners photos/ --board 9x6 --square 0.025 --out corners\n"
                   "alidade corners photos/*.jpg --board 9x6 --square 0.025 --csv > corners.csv\n"
                   "alidade calibrate --corners corners/corners.csv --size 640x480 --board 9x6 --square 0.025\n",
       .writes_at_end = true},
      [args](Run& run) { return run_corners(*args, run); });
  add_photos(command, args->photos, true);
  app.add_fields(command, fields_of(*args));
}

}  // namespace alidade::cli
