#include "alidade/rangefinder.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>

#include "alidade/board/board_fields.h"
#include "alidade/formats/beam_file.h"
#include "alidade/formats/camera_file.h"
#include "alidade/images/grey_image_file.h"
#include "alidade/images/table_photos.h"
#include "alidade/results/rangefinder_outcome.h"
#include "alidade/tables/corner_file.h"
#include "alidade/tables/scan_file.h"
#include "alidade/tables/shots_file.h"
#include "cli/app/app.h"
#include "cli/app/board_options.h"
#include "cli/commands/camera_values.h"
#include "cli/commands/commands.h"
#include "cli/commands/rangefinder_live.h"

namespace alidade::cli {
namespace {

struct RangefinderArgs {
  std::string shots, camera, corners, photo, initial_guess;  // files
  Board board = no_board();
  RangefinderConfig config;
  bool by_edges = false, skip_bad = false;
  GuidedShotsArgs guided;
};

/// A method of the shots, or edges, which takes a scan.
TextCode method_code(RangefinderArgs& args) {
  const TextCode word = words_code(args.config.method, rangefinder_method_words());
  TextCode code = word;
  code.words.emplace_back("edges");
  code.read = [&args, word, words = code.words](const std::string& text) -> std::string {
    args.by_edges = text == "edges";
    if (args.by_edges || word.read(text).empty()) return "";
    return "'" + text + "' is not one of joint, spot, plane, edges";
  };
  return code;
}

FieldList fields_of(RangefinderArgs& args) {
  FieldList fields = {
      {.name = "camera", .value = &args.camera, .help = "Camera file", .form = "FILE", .is_required = true}};
  for (Field& field : alidade::fields_of(args.config)) {
    if (field.name == "method") {
      field.value = method_code(args);
      field.help += "; edges: direction only, from a scan with the head (CSV pan,tilt,range_m) and --photo";
    }
    fields.push_back(std::move(field));
  }
  for (Field& field : alidade::fields_of(args.board, /*is_required=*/false)) fields.push_back(std::move(field));
  const FieldList inputs = {
      {.name = "corners",
       .value = &args.corners,
       .help = "Corners instead of photos: CSV photo,corner,u_px,v_px,…",
       .form = "FILE"},
      {.name = "photo",
       .value = &args.photo,
       .help = "With --method edges: photo taken with the head at zero",
       .form = "PHOTO"},
      {.name = "start",
       .value = &args.initial_guess,
       .help = "With --method edges: initial guess, a rangefinder.yaml (default: along the optical axis)",
       .form = "FILE"},
      {.name = "skip_bad", .value = &args.skip_bad, .help = "Skip invalid rows, naming each, instead of stopping"}};
  fields.insert(fields.end(), inputs.begin(), inputs.end());
  for (Field& field : fields_of(args.guided)) fields.push_back(std::move(field));
  return fields;
}

ExitCode by_edges(const RangefinderArgs& args, Run& run) {
  if (args.photo.empty()) throw UsageError("--method edges needs --photo");
  run.add_input("scan", args.shots);
  add_camera_input(run, args.camera);
  const std::vector<ScanRow> scan = read_scan(args.shots);
  const Camera camera = read_central_camera(args.camera);
  EdgesConfig config;
  if (!args.initial_guess.empty()) {
    run.add_input("start", args.initial_guess);
    config.initial_guess = read_beam(args.initial_guess).beam;
  }
  const std::string bytes = read_file(args.photo);
  run.add_input("photo", args.photo, bytes);
  const GreyImage photo = grey_image(bytes, args.photo, camera.width_px, camera.height_px);
  const EdgesCalibration result = rangefinder_by_edges(scan, photo, camera, config, run.progress);
  run.lap("align");
  return run.finish(outcome_of(result));
}

/// Corners of a table replace those in the photos. What of the table is not used is rejected by name.
std::vector<SkippedInput> take_corners(const RangefinderArgs& args, std::vector<Shot>& shots, Run& run) {
  if (!args.config.board) throw UsageError("--corners needs --board and --square");
  run.add_input("corners", args.corners);
  std::vector<SkippedInput> rows;
  const std::vector<BoardView> views =
      read_corners(args.corners, num_points(*args.config.board), args.skip_bad ? &rows : nullptr);
  for (SkippedInput& view : add_corners(args.corners, views, shots)) rows.push_back(std::move(view));
  return rows;
}

/// Corners that were not used are no shots: they are named, and do not count among those given.
void add_not_used(std::span<const SkippedInput> corners, JobOutcome& outcome) {
  std::vector<SkippedInput>& skipped = outcome.document.counts.skipped;
  skipped.insert(skipped.end(), corners.begin(), corners.end());
  std::vector<std::string> each;
  for (const SkippedInput& one : corners)
    each.push_back(one.file + (one.line > 0 ? ":" + std::to_string(one.line) : "") + ": " + one.reason);
  std::vector<std::string> lines;
  add_each("not used", each, lines);
  outcome.lines.insert(outcome.lines.begin(), lines.begin(), lines.end());
}

ExitCode by_shots(const RangefinderArgs& args, Run& run) {
  if (!args.photo.empty() || !args.initial_guess.empty())
    throw UsageError("--photo and --start are for --method edges");
  run.add_input("shots", args.shots);
  add_camera_input(run, args.camera);
  ShotsFile table = read_shots(args.shots, {.skip_bad = args.skip_bad});
  const Camera camera = read_central_camera(args.camera);
  const TablePhotos photos(args.shots, photo_roles(table.shots));
  PhotoByName load_photo = photos.loader();
  std::vector<SkippedInput> not_used;  // of the corners
  if (!args.corners.empty()) {
    not_used = take_corners(args, table.shots, run);
    load_photo = nullptr;
  }
  run.lap("read");
  RangefinderCalibration result = rangefinder(std::move(table.shots), camera, args.config, load_photo, run.progress);
  run.lap("solve");
  if (!result.unreadable.empty() && !args.skip_bad)
    refuse_photo_of(result.unreadable.front(), result.counts.skipped.front().reason);
  add_skipped(table.skipped, result.counts);
  JobOutcome outcome = outcome_of(result, std::filesystem::path(args.camera).filename().string());
  add_not_used(not_used, outcome);
  if (!run.options.no_report) add_images(result, load_photo, outcome);
  for (InputFile& input : photos.inputs()) run.document.inputs.push_back(std::move(input));
  return run.finish(std::move(outcome));
}

/// Shots that are taken one by one; what they give is what their table gives afterwards.
ExitCode by_guided_shots(RangefinderArgs args, Run& run) {
  if (!args.shots.empty()) throw UsageError("--live takes the shots itself: give no table");
  if (args.by_edges || !args.corners.empty())
    throw UsageError("--live takes shots: not with --method edges or --corners");
  const Camera camera = read_central_camera(args.camera);
  return rangefinder_live(camera, args.config, args.guided, run, [&](const std::filesystem::path& shots) {
    args.shots = shots.string();
    return by_shots(args, run);
  });
}

ExitCode run_rangefinder(RangefinderArgs args, Run& run) {
  if (is_given(args.board)) {
    require_board(args.board);
    args.config.board = args.board;
  }
  if (args.guided.live.is_on) return by_guided_shots(args, run);
  require_no_guided_shots(args.guided);
  if (args.shots.empty()) throw UsageError("give a table of shots, or --live");
  return args.by_edges ? by_edges(args, run) : by_shots(args, run);
}

}  // namespace

void add_rangefinder(App& app) {
  auto args = std::make_shared<RangefinderArgs>();
  CLI::App& command = app.add_command(
      {.name = "rangefinder",
       .summary = "Origin and direction of a laser rangefinder's beam in the camera frame",
       .examples = "alidade rangefinder shots.csv --camera camera.yaml --board 9x6 --square 0.04\n"
                   "alidade rangefinder shots.csv --camera camera.yaml --method spot --spot red\n"
                   "alidade rangefinder shots.csv --camera camera.yaml --method plane --scale --sigma-range-m 0.01\n"
                   "alidade rangefinder --live --camera camera.yaml --board 9x6 --square 0.04 --out mybeam\n",
       .writes_at_end = true},
      [args](Run& run) { return run_rangefinder(*args, run); });
  command.add_option("shots", args->shots,
                     "Table of shots, CSV: range_m with any of u,v (spot), photo[,photo_off], nx,ny,nz,d (plane, nx x "
                     "+ ny y + nz z + d = 0); omit with --live");
  add_guided_shots_options(command, args->guided);
  app.add_fields(command, fields_of(*args));
}

}  // namespace alidade::cli
