#include "alidade/observe.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "alidade/detect/video_log.h"
#include "alidade/formats/camera_file.h"
#include "alidade/formats/intrinsics_file.h"
#include "alidade/images/photos.h"
#include "alidade/live/streams.h"
#include "alidade/results/observe_outcome.h"
#include "alidade/tables/logs/rotation_log_stream.h"
#include "alidade/tables/pairs_file.h"
#include "cli/app/app.h"
#include "cli/app/live.h"
#include "cli/app/photo_options.h"
#include "cli/app/standard_input.h"
#include "cli/commands/camera_values.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct ObserveArgs {
  std::vector<std::string> inputs;  ///< A log, or photos.
  std::string log, pairs, video, angles, camera;
  std::optional<double> rate_hz;
  bool skip_bad = false;
  ObserveConfig config;
  LiveOptions live;
};

FieldList fields_of(ObserveArgs& args) {
  FieldList fields = {
      {.name = "pairs",
       .value = &args.pairs,
       .help = "Point matches between photos instead, many of which may be wrong, CSV: frame_a,frame_b,ua_px,…",
       .form = "FILE"},
      {.name = "video",
       .value = &args.video,
       .help = "Video file or folder of numbered frames instead; points are tracked in it",
       .form = "FILE|DIR"},
      {.name = "angles",
       .value = &args.angles,
       .help = "Rotation of the camera during the video, CSV: t, rotation columns",
       .form = "FILE"},
      {.name = "rate_hz",
       .value = &args.rate_hz,
       .help = "Frame rate [Hz], first frame at t = 0 (default: --angles has one row per frame)",
       .limits = {.min = 0.0, .is_above_min = true}},
      {.name = "camera",
       .value = &args.camera,
       .help = "Camera file with the initial guess and the lens distortion",
       .form = "FILE"},
      {.name = "skip_bad", .value = &args.skip_bad, .help = "Skip invalid rows, naming each, instead of stopping"}};
  for (Field& field : alidade::fields_of(args.config)) fields.push_back(std::move(field));
  return fields;
}

/// One log, photos, a video or matches; and what was given fits together.
void check_sources(ObserveArgs& args) {
  const bool has_photos = args.inputs.size() > 1 || (args.inputs.size() == 1 && looks_like_photos(args.inputs.front()));
  if (!has_photos && !args.inputs.empty()) args.log = std::exchange(args.inputs, {}).front();
  for (const std::string& input : args.inputs) {
    if (!looks_like_photos(input)) throw UsageError("'" + input + "' is no photo: give one log, or photos");
  }
  if (!args.log.empty() + has_photos + !args.pairs.empty() + !args.video.empty() != 1) {
    throw UsageError("give one of a rotation log, photos, --video FILE and --pairs FILE");
  }
  if (args.video.empty() != args.angles.empty()) throw UsageError("--video and --angles go together");
  if (args.video.empty() && args.rate_hz) throw UsageError("--rate is for --video");
}

/// What was seen is of another size than the config says.
void require_given_size(const ObserveConfig& config, int width_px, int height_px, const std::string& what) {
  const auto [width, height] = given_size(config);
  if (width == 0 || width_px == 0 || (width == width_px && height == height_px)) return;
  throw InputError(
      fmt::format("{} are {}x{}, but the camera or --size says {}x{}", what, width_px, height_px, width, height));
}

ExitCode observe_photos(const ObserveArgs& args, Run& run) {
  const PhotoSet set(std::vector<std::filesystem::path>(args.inputs.begin(), args.inputs.end()));
  const ObserveReport report = observe(set.photos(), args.config, run.progress);
  run.lap("observe");
  set.require_readable(report.num_unreadable, report.photos.empty() ? "" : report.photos.front().reason);
  require_given_size(args.config, report.width_px, report.height_px, "the photos");
  JobOutcome outcome = outcome_of(report);
  tell_photos(set, outcome.document.counts, outcome.document.verdict, run);
  return run.finish(std::move(outcome));
}

ExitCode observe_pairs(const ObserveArgs& args, Run& run) {
  run.add_input("pairs", args.pairs);
  PairsFile read = read_pairs(args.pairs, args.skip_bad);
  std::tie(read.photos.width_px, read.photos.height_px) = given_size(args.config);
  require_features_inside(read.photos, args.pairs);
  run.lap("read");
  JobOutcome outcome = outcome_of(observe(std::move(read.photos), args.config, run.progress));
  run.lap("observe");
  add_skipped(read.skipped, outcome);
  return run.finish(std::move(outcome));
}

/// Points followed through a video.
ExitCode observe_video(ObserveArgs args, Run& run) {
  run.add_input("angles", args.angles);
  const RotationLog angles = read_angles(args.angles);
  VideoFrames video(args.video);
  if (std::filesystem::is_regular_file(args.video)) run.add_input("video", args.video);
  const VideoLog made =
      log_from_video(video, angles, args.angles, {.rate_hz = args.rate_hz.value_or(0.0)}, run.progress);
  require_given_size(args.config, made.width_px, made.height_px, args.video + ": frames");
  std::tie(args.config.width_px, args.config.height_px) = std::pair(made.width_px, made.height_px);
  run.lap("read");
  JobOutcome outcome = outcome_of(observe(made.log, args.config, run.progress));
  run.lap("observe");
  add_video(made, outcome);
  return run.finish(std::move(outcome));
}

ExitCode observe_log(const ObserveArgs& args, Run& run) {
  run.add_input("log", args.log);
  const bool needs_rotation = args.config.rotation != RotationKnowledge::free;
  RotationLogFile read = read_rotation_log(args.log, {.skip_bad = args.skip_bad, .needs_rotation = needs_rotation});
  run.lap("read");
  JobOutcome outcome = outcome_of(observe(std::move(read.log), args.config, run.progress));
  run.lap("observe");
  add_skipped(read.skipped, outcome);
  return run.finish(std::move(outcome));
}

/// Rows from standard input as they come, each answered at once with a row of intrinsics.csv.
ExitCode observe_input(const ObserveArgs& args, LiveRun& live, Run& run) {
  const auto [width_px, height_px] = given_size(args.config);
  const live::ObserveStream view(width_px, height_px);
  live.open(view.topics(), "/observe");  // who watches may come before the first row
  StandardInput input;                   // Ctrl-C ends waiting for a row
  std::optional<ObserveStep> last;
  RotationLogStream stream(input, "-", {.skip_bad = args.skip_bad});
  Observer observer(stream.layout(), args.config);
  const bool shows = !run.options.json && !run.options.quiet;
  if (shows) std::cout << intrinsics_csv({}, {}) << std::flush;
  while (auto entry = stream.next()) {
    report_progress(run.progress, "rows", observer.num_rows(), 0);
    if (!last) observer = Observer(stream.layout(), args.config);  // the first row has the log's σ
    last = observer.push(std::move(entry->row), entry->truth);
    if (live.server() != nullptr) view.show(*live.server(), *last);
    const std::string table = intrinsics_csv({&last->t_s, 1}, {&last->estimate, 1});
    if (shows) std::cout << table.substr(table.find('\n') + 1) << std::flush;
  }
  if (last && live.server() != nullptr) view.show(*live.server(), *last, true);
  report_progress(run.progress, "rows", observer.num_rows(), 0);  // the input may have ended by Ctrl-C
  run.lap("read");
  JobOutcome outcome = outcome_of(observer.finish(run.progress));
  run.lap("observe");
  add_skipped(stream.skipped(), outcome);
  return live.finish(std::move(outcome));
}

ExitCode run_observe(ObserveArgs args, Run& run) {
  check_sources(args);
  LiveRun live(args.live, run);
  if (live.is_on() && args.log != "-") throw UsageError("--live: only for rows from standard input, observe -");
  check_config(args.config);
  if (!args.camera.empty()) {
    add_camera_input(run, args.camera);
    args.config.camera = read_central_camera(args.camera);
  }
  if (!args.inputs.empty()) return observe_photos(args, run);
  if (!args.pairs.empty()) return observe_pairs(args, run);
  if (!args.video.empty()) return observe_video(args, run);
  return args.log == "-" ? observe_input(args, live, run) : observe_log(args, run);
}

}  // namespace

void add_observe(App& app) {
  auto args = std::make_shared<ObserveArgs>();
  CLI::App& command = app.add_command(
      {.name = "observe",
       .summary = "Intrinsics of a rotating (pan-tilt-zoom) camera from what it sees while it rotates",
       .examples = "alidade observe log.csv --size 780x582\n"
                   "alidade observe log.csv --camera prior.yaml --estimate k1,mount,delay\n"
                   "alidade observe --video ptz.mp4 --angles encoder.csv --rate 30\n"
                   "alidade observe log.csv --method fang2011 --profile quiet --start 500,510,400,300\n"
                   "alidade observe photos/*.jpg --rotation free\n"
                   "alidade observe --pairs matches.csv --rotation free --square-pixels --fix-centre --size 1280x960\n",
       .writes_at_end = true},
      [args](Run& run) { return run_observe(*args, run); });
  command.add_option("log", args->inputs,
                     "Rotation log, CSV: t, rotation columns, p1x,p1y,p2x,p2y,…; -: read rows from standard input and "
                     "answer each; or photos, or folders of photos, of a camera rotated on the spot");
  app.add_fields(command, fields_of(*args));
  add_live_options(command, args->live, false);
}

}  // namespace alidade::cli
