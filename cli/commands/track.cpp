#include "alidade/track.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>

#include "alidade/detect/target_look.h"
#include "alidade/detect/video_observations.h"
#include "alidade/formats/intrinsics_file.h"
#include "alidade/formats/rig_file.h"
#include "alidade/live/streams.h"
#include "alidade/results/track_outcome.h"
#include "alidade/tables/events_file.h"
#include "alidade/tables/logs/events_stream.h"
#include "alidade/track/track.h"
#include "cli/app/app.h"
#include "cli/app/live.h"
#include "cli/app/standard_input.h"
#include "cli/app/truth_times.h"
#include "cli/commands/camera_values.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct TrackArgs {
  std::string events, rig, truth, angles;
  std::vector<std::string> videos, intrinsics;
  NamedLook look;
  std::optional<double> rate_hz;
  bool skip_bad = false;
  TrackConfig config;
  LiveOptions live;
};

FieldList fields_of(TrackArgs& args) {
  FieldList fields = {
      {.name = "angles",
       .value = &args.angles,
       .help = "With --video: angles of the heads, CSV: t_s,head,pan_rad,tilt_rad",
       .form = "FILE"},
      look_field(args.look),
      {.name = "rate_hz",
       .value = &args.rate_hz,
       .help = "Frame rate of the videos [Hz]; angles are interpolated (default: one row of angles per frame)",
       .limits = {.min = 0.0, .is_above_min = true}},
      {.name = "rig",
       .value = &args.rig,
       .help = "Heads and their cameras (rig.yaml)",
       .form = "FILE",
       .is_required = true},
      {.name = "truth",
       .value = &args.truth,
       .help = "True path, CSV: t_s,x_m,y_m,z_m; adds errors, NEES and the Cramér–Rao bound",
       .form = "FILE"}};
  for (Field& field : alidade::fields_of(args.config)) fields.push_back(std::move(field));
  fields.push_back(
      {.name = "skip_bad", .value = &args.skip_bad, .help = "Skip invalid rows, naming each, instead of stopping"});
  return fields;
}

void check_inputs(const TrackArgs& args) {
  const bool has_look = !args.look.text.empty();
  if (args.events.empty() == args.videos.empty()) throw UsageError("give one of an events file and --video");
  if (args.videos.empty() && (!args.angles.empty() || has_look || args.rate_hz))
    throw UsageError("--angles, --look and --rate are for --video");
  if (!args.videos.empty() && (args.angles.empty() || !has_look)) throw UsageError("--video needs --angles and --look");
}

/// One file of intrinsics per head beats what rig.yaml names; - for a head that does not zoom.
void read_intrinsics_histories(const TrackArgs& args, Rig& rig, Run& run) {
  if (args.intrinsics.empty()) return;
  if (args.intrinsics.size() != rig.heads.size())
    throw UsageError(
        fmt::format("--intrinsics: the rig has {} heads, but {} files are given; - for a head that does not zoom",
                    rig.heads.size(), args.intrinsics.size()));
  rig.intrinsics_histories.clear();
  for (const std::string& file : args.intrinsics) {
    rig.intrinsics_histories.push_back(file == "-" ? IntrinsicsHistory{} : read_intrinsics_history(file));
    if (file != "-") run.add_input("intrinsics", file);
  }
}

/// The target in the frames of the heads' videos.
std::vector<TargetFrame> watch_videos(TrackArgs& args, const Rig& rig, const Progress& progress, Run& run) {
  if (args.videos.size() != rig.heads.size())
    throw UsageError(
        fmt::format("--video: the rig has {} heads, but {} videos are given", rig.heads.size(), args.videos.size()));
  run.add_input("angles", args.angles);
  load_look(args.look);
  if (args.look.pattern) run.add_input("pattern", args.look.pattern_file);
  const HeadAngles angles = read_head_angles(args.angles, rig.heads);
  std::vector<VideoFrames> videos;
  for (const std::string& video : args.videos) {
    videos.emplace_back(video, args.look.look.kind == TargetKind::colour ? FrameColour::bgr : FrameColour::grey);
    if (std::filesystem::is_regular_file(video)) run.add_input("video", video);
  }
  std::vector<TargetFrame> frames = target_frames(videos, angles, rig.heads, args.look.look, args.look.pattern.get(),
                                                  {.rate_hz = args.rate_hz.value_or(0.0)}, progress);
  run.lap("look");
  return frames;
}

/// Follows the observations, and shows them as it does.
TargetTrack follow(const TrackArgs& args, std::vector<TargetObservation> observations, const Rig& rig,
                   const TrueTrack& truth, const live::TrackStream& stream, LiveRun& live) {
  if (live.server() == nullptr)
    return alidade::track(std::move(observations), rig, args.config, truth, live.progress());
  const TrackWatch watch = [&](const TargetObservation& observation, const TrackStep& step) {
    live.keep_pace(observation.t_arrival_s);
    stream.show(*live.server(), observation, step);
  };
  TargetTrack result = alidade::track(std::move(observations), rig, args.config, truth, live.progress(), watch);
  if (!result.steps.empty())
    stream.show(*live.server(), result.observations.back(), result.steps.back(), /*is_last=*/true);
  return result;
}

/// A truth that no position after the warm-up has its time in is refused; a track that is all warm-up has none.
void require_same_times(const std::filesystem::path& file, const TargetTrack& result) {
  if (result.truth.t_s.empty() || std::isfinite(result.rms_m) ||
      !is_estimate(static_cast<int>(result.verdict.exit_code)))
    return;
  std::vector<double> t_s;
  for (const TrackStep& step : result.steps)
    if (step.has_belief) t_s.push_back(step.t_s);
  const auto num_true = std::ranges::count_if(t_s, [&](double each_s) { return result.truth.at(each_s).has_value(); });
  if (t_s.empty() || num_true == std::ssize(t_s)) return;
  throw truth_of_other_times(
      file, {result.truth.t_s.front(), result.truth.t_s.back()}, {std::ranges::min(t_s), std::ranges::max(t_s)},
      fmt::format("{} of {} positions have their time in it, none of them after the first {:g} s", num_true, t_s.size(),
                  FollowConfig{}.warm_up_s));
}

/// Rows from standard input as they come, each answered at once with a row of track.csv.
ExitCode follow_input(const TrackArgs& args, const Rig& rig, const TrueTrack& truth, const live::TrackStream& view,
                      LiveRun& live, Run& run) {
  StandardInput input;  // Ctrl-C ends waiting for a row
  EventsStream events(input, "-", rig.heads, {.skip_bad = args.skip_bad});
  TargetTracker tracker(rig, args.config);
  const bool shows = !run.options.json && !run.options.quiet;
  if (shows) std::cout << track_csv({}) << std::flush;
  const std::size_t header = track_csv({}).size();
  std::size_t count = 0;
  while (const std::optional<TargetObservation> observation = events.next()) {
    report_progress(run.progress, "rows", ++count, 0);
    const TrackStep step = tracker.push(*observation);
    if (live.server() != nullptr) view.show(*live.server(), *observation, step);
    if (shows) std::cout << track_csv({&step, 1}).substr(header) << std::flush;
  }
  report_progress(run.progress, "rows", count, 0);  // the input may have ended by Ctrl-C
  run.lap("read");
  const TargetTrack result = tracker.finish(truth, run.progress);
  require_same_times(args.truth, result);
  JobOutcome outcome = outcome_of(result);
  run.lap("track");
  add_skipped(events.skipped(), outcome);
  return live.finish(std::move(outcome));
}

ExitCode run_track(TrackArgs args, Run& run) {
  check_inputs(args);
  require_sense(args.config);
  Rig rig = read_rig(args.rig);
  add_rig_input(run, args.rig);
  read_intrinsics_histories(args, rig, run);
  TrueTrack truth;
  if (!args.truth.empty()) {
    run.add_input("truth", args.truth);
    truth = read_true_track(args.truth);
  }
  LiveRun live(args.live, run);
  const live::TrackStream stream(rig.heads, truth);
  if (live.is_on()) live.open(stream.topics(), "/track");
  if (live.server() != nullptr) stream.begin(*live.server());
  if (args.events == "-") return follow_input(args, rig, truth, stream, live, run);
  std::vector<TargetFrame> frames;
  EventsFile events;
  if (args.videos.empty()) {
    run.add_input("events", args.events);
    events = read_events(args.events, rig.heads, {.skip_bad = args.skip_bad});
  } else {
    frames = watch_videos(args, rig, live.progress(), run);
    events.observations = observations_of(frames);
  }
  if (const std::string fault = intrinsics_history_fault(events.observations, rig); !fault.empty())
    throw InputError(fault);
  run.lap("read");
  const TargetTrack result = follow(args, std::move(events.observations), rig, truth, stream, live);
  run.lap("track");
  require_same_times(args.truth, result);
  JobOutcome outcome = args.videos.empty() ? outcome_of(result) : outcome_of(result, frames);
  add_skipped(events.skipped, outcome);
  return live.finish(std::move(outcome));
}

}  // namespace

void add_track(App& app) {
  auto args = std::make_shared<TrackArgs>();
  CLI::App& command = app.add_command(
      {.name = "track",
       .summary = "3-D path of a target from the pixels and angles of two or more pan-tilt heads",
       .examples = "alidade track events.csv --rig rig.yaml\n"
                   "alidade track events.csv --rig rig.yaml --method imm --predict 0.1\n"
                   "  tail -f events.csv | alidade track - --rig rig.yaml\n"
                   "alidade track events.csv --rig rig.yaml --truth truth.csv --method xiahou2015\n"
                   "alidade track events.csv --rig rig.yaml --intrinsics left/intrinsics.csv right/intrinsics.csv\n"
                   "alidade track --video left.mp4 right.mp4 --angles angles.csv --rate 30 --rig rig.yaml \\\n"
                   "  --look colour:230,70,20\n",
       .writes_at_end = true},
      [args](Run& run) { return run_track(*args, run); });
  command.add_option("events", args->events,
                     "Events, CSV: t_capture_s,t_arrival_s,head,pan_rad,tilt_rad,u_px,v_px, in order of arrival; -: "
                     "read rows from standard input and answer each, until the end with 1 m/s2 and 0.5 px unless "
                     "--sigma-a and --sigma-px are given; the final result estimates them");
  command
      .add_option("--video", args->videos,
                  "Videos or folders of numbered frames instead, one per head, in the order of the rig")
      ->type_name("FILE");
  command
      .add_option("--intrinsics", args->intrinsics,
                  "intrinsics.csv of `alidade observe`, one per head in the order of the rig (- for a head that does "
                  "not zoom): each observation uses the lens at its time, with its σ included; or set `intrinsics:` of "
                  "a head in rig.yaml")
      ->type_name("FILE");
  app.add_fields(command, fields_of(*args));
  add_live_options(command, args->live);
}

}  // namespace alidade::cli
