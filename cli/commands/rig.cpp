#include "alidade/rig.h"

#include <CLI/CLI.hpp>
#include <memory>

#include "alidade/board/board_fields.h"
#include "alidade/formats/rig_file.h"
#include "alidade/images/table_photos.h"
#include "alidade/network.h"
#include "alidade/results/network_outcome.h"
#include "alidade/results/rig_outcome.h"
#include "alidade/tables/events_file.h"
#include "alidade/tables/views_file.h"
#include "cli/app/app.h"
#include "cli/app/board_options.h"
#include "cli/commands/camera_values.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct RigArgs {
  std::filesystem::path views;
  std::vector<std::filesystem::path> cameras;
  Board board = no_board();
  RigConfig config;
  bool by_moving_target = false, skip_bad = false;
  MovingTargetConfig moving;
  std::string truth;  // a file
};

FieldList fields_of(RigArgs& args) {
  FieldList fields = alidade::fields_of(args.board, /*is_required=*/false);
  for (Field& field : alidade::fields_of(args.config)) fields.push_back(std::move(field));
  fields.push_back(
      {.name = "skip_bad", .value = &args.skip_bad, .help = "Skip invalid rows, naming each, instead of stopping"});
  const std::string group = "Cameras that do not rotate";
  fields.push_back({.name = "moving_target",
                    .value = &args.by_moving_target,
                    .help = "The table has observations of one moving target, t_capture_s,head,u_px,v_px, by cameras "
                            "that do not rotate: estimates their positions, attitudes and clocks; no board",
                    .group = group});
  for (Field& field : alidade::fields_of(args.moving))
    if (field.name != "sigma_px") fields.push_back(std::move(field));  // the rig's own
  fields.push_back({.name = "truth",
                    .value = &args.truth,
                    .help = "Reference path of the target (GNSS), CSV: t_s,x_m,y_m,z_m; fixes scale, frame and clock",
                    .form = "FILE",
                    .group = group});
  return fields;
}

ExitCode by_moving_target(const RigArgs& args, Run& run) {
  const std::vector<int> ids = heads_in_events(args.views, args.skip_bad);
  const std::vector<RigHead> heads = heads_with(read_cameras_by_head(args.cameras, ids, args.views));
  const EventsFile table = read_events(args.views, heads, {.skip_bad = args.skip_bad, .stands_still = true});
  TrueTrack truth;
  if (!args.truth.empty()) {
    run.add_input("truth", args.truth);
    truth = read_true_track(args.truth);
  }
  run.lap("read");
  MovingTargetConfig config = args.moving;
  config.sigma_px = args.config.sigma_px;
  NetworkCalibration result = network(table.observations, heads, config, truth, run.progress);
  run.lap("solve");
  add_skipped(table.skipped, result.counts);
  return run.finish(outcome_of(result));
}

ExitCode by_views(RigArgs args, Run& run) {
  if (is_given(args.board)) {
    require_board(args.board);
    args.config.board = args.board;
  }
  const int num = args.config.board ? num_points(*args.config.board) : 0;
  require_none(faults(args.config));
  ViewsFile table = read_views(args.views, {.skip_bad = args.skip_bad, .num_points = num});
  const std::map<int, Camera> cameras = read_cameras_by_head(args.cameras, heads_of(table.views), args.views);
  require_corners_inside(args.views, table.views, cameras);
  run.lap("read");
  const TablePhotos photos(args.views);
  RigCalibration result = rig(std::move(table.views), cameras, args.config,
                              table.has_photos ? photos.loader() : PhotoByName(), run.progress);
  run.lap("solve");
  if (!result.unreadable.empty() && !args.skip_bad) refuse_photo(args.views, result.unreadable.front());
  add_skipped(table.skipped, result.counts);
  for (InputFile& input : photos.inputs()) run.document.inputs.push_back(std::move(input));
  return run.finish(outcome_of(result));
}

ExitCode run_rig(const RigArgs& args, Run& run) {
  if (!args.by_moving_target && (args.moving.clock_search_s > 0.0 || args.moving.distance || !args.truth.empty()))
    throw UsageError("--clocks, --distance and --truth are for --moving-target");
  run.add_input(args.by_moving_target ? "events" : "views", args.views);
  for (const std::filesystem::path& camera : args.cameras) add_camera_input(run, camera);
  return args.by_moving_target ? by_moving_target(args, run) : by_views(args, run);
}

}  // namespace

void add_rig(App& app) {
  auto args = std::make_shared<RigArgs>();
  CLI::App& command = app.add_command(
      {.name = "rig",
       .summary = "Axes, offsets and mounting of pan-tilt heads, and their relative poses",
       .examples =
           "alidade rig views.csv --camera camera.yaml --board 9x6 --square 0.025\n"
           "alidade rig views.csv --camera left.yaml --camera right.yaml --board 9x6 --square 0.025\n"
           "alidade rig views.csv --camera camera.yaml --board 9x6 --square 0.025 --sigma-angle 0.0003\n"
           "alidade rig sights.csv --moving-target --clocks 60 --truth gnss.csv --camera a.yaml --camera b.yaml\n",
       .writes_at_end = true},
      [args](Run& run) { return run_rig(*args, run); });
  command
      .add_option("views", args->views,
                  "Table of views, CSV: view,board,head,pan_rad,tilt_rad with corner,u,v (one row per corner) or photo "
                  "(one row per view); `board` numbers the positions of the board")
      ->required();
  command
      .add_option("--camera", args->cameras,
                  "Camera file, one for all heads or one per head in the order of their numbers")
      ->type_name("FILE")
      ->required()
      ->expected(1)
      ->take_all();
  app.add_fields(command, fields_of(*args));
}

}  // namespace alidade::cli
