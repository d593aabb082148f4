#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <memory>

#include "alidade/detect/video_observations.h"
#include "alidade/formats/intrinsics_file.h"
#include "alidade/formats/rig_file.h"
#include "alidade/live/streams.h"
#include "alidade/results/track_document.h"
#include "alidade/tables/events_file.h"
#include "alidade/track/lens_over_time.h"
#include "alidade/track/track.h"
#include "alidade/track/track_assumed.h"
#include "cli/app/app.h"
#include "cli/app/live.h"
#include "cli/app/option_checks.h"
#include "cli/commands/commands.h"
#include "cli/commands/target_look.h"

namespace alidade::cli {
namespace {

struct TrackArgs {
  std::filesystem::path events, rig, truth, angles;
  std::vector<std::string> videos, intrinsics;
  std::string target;
  double rate_hz = 0.0;
  std::string method = "cv";
  std::vector<double> gravity_m_s2;
  bool corrected = false, skip_bad = false;
  double sigma_a = 0.0, sigma_px = 0.0, sigma_clock_s = 0.0;
  TrackConfig config;
  LiveOptions live;
};

TrackMethod method_of(const std::string& name) {
  for (const TrackMethod method : {TrackMethod::singer, TrackMethod::turn, TrackMethod::imm, TrackMethod::ballistic})
    if (method_name(method) == name) return method;
  return TrackMethod::cv;
}

TrackConfig config_of(const TrackArgs& args) {
  TrackConfig config = args.config;
  config.tracker.method = method_of(args.method);
  config.find_sigma_a = !(args.sigma_a > 0.0);
  if (args.sigma_px > 0.0) config.tracker.sigma_px = args.sigma_px;
  if (args.sigma_a > 0.0) config.tracker.sigma_a_m_s2 = args.sigma_a;
  if (!args.gravity_m_s2.empty()) {
    if (args.method != "ballistic" && args.method != "imm")
      throw UsageError("--gravity: only with --method ballistic or imm");
    config.tracker.gravity_m_s2 = Eigen::Vector3d(args.gravity_m_s2.data());
  }
  if (config.tracker.min_depth_m >= config.tracker.max_depth_m)
    throw UsageError("--min-depth: is not below --max-depth");
  if (config.smooth_s > 0.0 && (args.method == "imm" || args.method == "xiahou2015"))
    throw UsageError("--smooth: not for --method " + args.method);
  return config;
}

/// The paper's filter on the same events.
std::pair<TrackReport, Verdict> track_as_paper(const TrackArgs& args, std::span<const TargetObservation> observations,
                                               std::span<const RigHead> heads, const TrueTrack& truth,
                                               const TrackWatch& watch) {
  XiahouConfig config;
  if (heads.size() != 2) throw UsageError("--method xiahou2015: needs a rig of two heads");
  config.baseline_cm =
      100.0 * (heads[1].head.world_from_base.translation - heads[0].head.world_from_base.translation).norm();
  config.use_pixels = args.corrected;
  TrackReport report = track_target_xiahou(observations, heads, config, truth, watch);
  Verdict verdict;
  if (report.num_starts == 0) {
    verdict = {State::refused,
               ExitCode::cannot_tell,
               "the two heads' axes never meet in front of them",
               "check that events of both heads are there, or use --method cv",
               {}};
  } else {
    verdict.state = State::care;
    verdict.sentence = "the paper's filter: no gates, and its covariance does not say how good it is";
  }
  return {std::move(report), std::move(verdict)};
}

void summarize(const TrackReport& report, Run& run) {
  if (report.steps.empty() || !report.steps.back().has_belief) return;
  const TrackStep& last = report.steps.back();
  const std::array<const char*, 3> axes{"x", "y", "z"};
  for (int i = 0; i < 3; ++i) {
    run.say(fmt::format("{} {:9.4f} ± {:.2g} m, {:7.3f} ± {:.2g} m/s   (3σ, at {:.3f} s)",
                        axes[static_cast<std::size_t>(i)], last.belief.x[i], 3.0 * std::sqrt(last.belief.P(i, i)),
                        last.belief.x[3 + i], 3.0 * std::sqrt(last.belief.P(3 + i, 3 + i)), last.t_s));
  }
  if (std::isfinite(report.nis_per_dof))
    run.say(fmt::format("NIS per degree of freedom {:.2f}; the target's acceleration {:.2g} m/s² ({})",
                        report.nis_per_dof, report.sigma_a_m_s2,
                        report.sigma_a_is_found ? "told by the innovations" : "as given"));
  if (std::isfinite(report.rms_m))
    run.say(fmt::format("against the truth: RMS {:.2f} mm, mean {:.2f} mm, NEES {:.2f}", 1e3 * report.rms_m,
                        1e3 * report.mean_error_m, report.nees_per_dof));
  if (std::isfinite(report.smoothed_rms_m))
    run.say(fmt::format("smoothed: RMS {:.2f} mm", 1e3 * report.smoothed_rms_m));
  if (std::isfinite(report.pcrlb_m)) run.say(fmt::format("bound (PCRLB) {:.2f} mm", 1e3 * report.pcrlb_m));
}

/// The target found in the frames of the heads' videos. The result tells its observations, events.csv, so that they can
/// be looked at and used again.
EventsFile watch_videos(const TrackArgs& args, const Rig& rig, const Progress& progress, Run& run) {
  if (args.videos.size() != rig.heads.size())
    throw UsageError(
        fmt::format("--video: the rig has {} heads, but {} videos are given", rig.heads.size(), args.videos.size()));
  run.add_input("angles", args.angles);
  const TargetOption target = read_target_option(args.target, run);
  const HeadAngles angles = read_head_angles(args.angles, rig.heads);
  std::vector<VideoFrames> videos;
  for (const std::string& video : args.videos) {
    videos.emplace_back(video, target.look.kind == TargetKind::colour ? FrameColour::bgr : FrameColour::grey);
    if (std::filesystem::is_regular_file(video)) run.add_input("video", video);
  }
  const std::vector<TargetFrame> frames =
      target_frames(videos, angles, rig.heads, target.look, target.pattern.get(), {.rate_hz = args.rate_hz}, progress);
  run.lap("look");
  EventsFile events{observations_of(frames), {}};
  fill_target_frames(frames, rig.heads, run.document);
  run.say(fmt::format("target seen in {} of {} frames", events.observations.size(), frames.size()));
  if (!events.observations.empty()) run.add_file("events.csv", events_csv(events.observations, rig.heads));
  return events;
}

EventsFile observations_given(const TrackArgs& args, const Rig& rig, const Progress& progress, Run& run) {
  if (!args.videos.empty()) return watch_videos(args, rig, progress, run);
  run.add_input("events", args.events);
  return read_events(args.events, rig.heads, {.skip_bad = args.skip_bad});
}

void check_inputs(const TrackArgs& args) {
  if (args.events.empty() == args.videos.empty()) throw UsageError("give one of an events file and --video");
  if (args.videos.empty() && !(args.angles.empty() && args.target.empty() && args.rate_hz == 0.0))
    throw UsageError("--angles, --target and --rate are for --video");
  if (!args.videos.empty() && (args.angles.empty() || args.target.empty()))
    throw UsageError("--video needs --angles and --target");
}

/// Nothing was seen at all.
Verdict never_seen() {
  return {State::refused,
          ExitCode::cannot_tell,
          "the target is in no frame of the videos",
          "check --target against a frame, and that the target is in the picture",
          {}};
}

/// Follows the observations, and shows them as it does.
std::pair<TrackReport, Verdict> follow(const TrackArgs& args, std::span<const TargetObservation> observations,
                                       std::span<const RigHead> heads, const TrackConfig& config,
                                       const TrueTrack& truth, const live::TrackStream& stream, LiveRun& live,
                                       Run& run) {
  TrackWatch watch;
  if (live.server() != nullptr)
    watch = [&](const TargetObservation& observation, const TrackStep& step) {
      live.keep_pace(observation.t_arrival_s);
      stream.show(*live.server(), observation, step);
    };
  std::pair<TrackReport, Verdict> result;
  if (args.method == "xiahou2015") {
    result = track_as_paper(args, observations, heads, truth, watch);
  } else {
    result.first = track_target(observations, heads, config, truth, watch);
    run.lap("track");
    result.second = track_verdict(result.first, observations, heads, config);
  }
  if (watch) stream.show(*live.server(), observations.back(), result.first.steps.back(), true);
  return result;
}

/// The intrinsics over time that --intrinsics, else rig.yaml, names of heads that zoom.
std::vector<LensCourse> courses_given(const TrackArgs& args, const Rig& rig, Run& run) {
  if (args.intrinsics.empty()) return rig.lens_courses;
  if (args.intrinsics.size() != rig.heads.size())
    throw UsageError(
        fmt::format("--intrinsics: the rig has {} heads, but {} files are given; - for a head that does "
                    "not zoom",
                    rig.heads.size(), args.intrinsics.size()));
  std::vector<LensCourse> courses;
  for (const std::string& file : args.intrinsics) {
    courses.push_back(file == "-" ? LensCourse{} : read_lens_course(file));
    if (file != "-") run.add_input("intrinsics", file);
  }
  return courses;
}

/// Each observation gets the intrinsics of its time.
void zoom_with(const std::vector<LensCourse>& courses, std::vector<TargetObservation>& observations, Rig& rig) {
  constexpr double beyond_s = 1.0;  // how far what an observer last said is believed to go on
  if (courses.empty()) return;
  if (const auto outside = outside_course(observations, courses, beyond_s)) {
    const LensCourse& course = courses[outside->head];
    throw InputError(
        fmt::format("{}: tells head {}'s intrinsics from {:.6g} to {:.6g} s, but there is a sight at {:.6g} s; "
                    "are the clocks the same?",
                    course.name, rig.heads[outside->head].head.id, course.from_s, course.until_s, outside->t_s));
  }
  use_courses(courses, observations, rig);
}

/// What is assumed of a lens that zooms is not the rig's one number.
void name_courses(const std::vector<LensCourse>& courses, const Rig& rig, std::vector<Assumption>& assumed) {
  for (std::size_t h = 0; h < courses.size(); ++h) {
    if (courses[h].lens.empty()) continue;
    const std::string of_camera = fmt::format("head{}.camera.", rig.heads[h].head.id);
    for (Assumption& one : assumed) {
      if (!one.name.starts_with(of_camera)) continue;
      const std::string what = one.name.substr(of_camera.size());
      if (what != "fx" && what != "fy" && what != "cx" && what != "cy") continue;
      one.name = fmt::format("head{}.intrinsics.{}", rig.heads[h].head.id, what);
      one.value = std::numeric_limits<double>::quiet_NaN();
    }
  }
}

TrueTrack truth_given(const TrackArgs& args, Run& run) {
  if (args.truth.empty()) return {};
  run.add_input("truth", args.truth);
  return read_true_track(args.truth);
}

ExitCode track(const TrackArgs& args, Run& run) {
  check_inputs(args);
  TrackConfig config = config_of(args);
  if (args.corrected && args.method != "xiahou2015") throw UsageError("--corrected: only with --method xiahou2015");
  run.add_input("rig", args.rig);
  Rig rig = read_rig(args.rig);
  const std::vector<LensCourse> courses = courses_given(args, rig, run);
  const TrueTrack truth = truth_given(args, run);
  LiveRun live(args.live, run);
  const live::TrackStream stream(rig.heads, truth);
  if (live.is_on()) live.open(stream.topics(), "/track");
  if (live.server() != nullptr) stream.begin(*live.server());
  EventsFile events = observations_given(args, rig, live.progress(), run);
  if (events.observations.empty()) return live.finish(never_seen());
  zoom_with(courses, events.observations, rig);
  config.tracker.errors = rig_uncertainty(rig, args.sigma_clock_s);
  run.lap("read");
  auto [report, verdict] = follow(args, events.observations, rig.heads, config, truth, stream, live, run);
  if (args.method != "xiahou2015" && verdict.exit_code == ExitCode::ok) {
    run.document.assumed = track_assumed(
        events.observations, rig, config, report,
        {.sigma_px = args.sigma_px > 0.0, .sigma_a = args.sigma_a > 0.0, .sigma_clock_s = args.sigma_clock_s});
    name_courses(courses, rig, run.document.assumed);
    heed_assumptions(run.document.assumed, verdict);
  }
  run.lap("verdict");
  run.document.counts.given = events.skipped.size();
  run.document.counts.skipped = events.skipped;
  fill_track(events.observations, rig.heads, report, truth, run.document);
  summarize(report, run);
  if (has_estimate(verdict)) run.add_file("track.csv", track_csv(report.steps, report.ahead));
  if (has_estimate(verdict) && !report.smoothed.empty()) run.add_file("smoothed.csv", smoothed_csv(report.smoothed));
  return live.finish(verdict);
}

void add_options(CLI::App& command, TrackArgs& args) {
  command.add_option("events", args.events,
                     "Events, CSV: t_capture_s,t_arrival_s,head,pan_rad,tilt_rad,u_px,v_px, in order of arrival");
  command
      .add_option("--video", args.videos,
                  "Videos or folders of numbered frames instead, one a head of the rig, in its order")
      ->type_name("FILE");
  command.add_option("--angles", args.angles, "With --video: t_s,head,pan_rad,tilt_rad, CSV")->type_name("FILE");
  command.add_option("--target", args.target, target_help)->type_name("LOOK");
  command
      .add_option("--rate", args.rate_hz,
                  "Frames a second of the videos; angles are interpolated (default: one row of angles a frame)")
      ->check(positive_number());
  command.add_option("--rig", args.rig, "The heads and their cameras")->type_name("FILE")->required();
  command
      .add_option(
          "--intrinsics", args.intrinsics,
          "intrinsics.csv of `alidade observe`, one a head of the rig in its order (- for a head that does not "
          "zoom): each sight is taken with the lens of its time, whose σ is counted; or `intrinsics:` of a head "
          "in rig.yaml")
      ->type_name("FILE");
  command.add_option("--truth", args.truth, "True path, CSV: t_s,x_m,y_m,z_m; adds errors, NEES and the bound")
      ->type_name("FILE");
  command
      .add_option(
          "--method,--motion", args.method,
          "Motion of the target: cv (constant velocity), singer, turn, imm (quiet, agile or falling), ballistic (free "
          "fall); or the filter of xiahou2015")
      ->check(CLI::IsMember({"cv", "singer", "turn", "imm", "ballistic", "xiahou2015"}))
      ->capture_default_str();
  command
      .add_option(
          "--gravity", args.gravity_m_s2,
          "With ballistic and imm: gravity in the rig's world [m/s2] (default: 0 9.80665 0, the first camera level)")
      ->expected(3)
      ->check(finite_number());
  command.add_flag("--corrected", args.corrected, "With xiahou2015: pixels and mounting corrected, else as printed");
  command.add_option("--predict", args.config.predict_s, "Rows so far ahead of each event [s]")
      ->check(positive_number());
  command
      .add_option("--smooth", args.config.smooth_s,
                  "Also smoothed.csv: the path as the sights until so long after tell it [s]; not for imm")
      ->check(finite_number() & CLI::Range(0.01, 2.0));
  command.add_option("--sigma-a", args.sigma_a, "The target's acceleration [m/s2] (default: told by the innovations)")
      ->check(positive_number());
  const auto number = [&](const char* name, double& value, const char* help) {
    command.add_option(name, value, help)->check(positive_number())->capture_default_str();
  };
  command.add_option("--sigma-px", args.sigma_px, "σ of the target's pixel coordinate [px] (default 0.5)")
      ->check(positive_number());
  command
      .add_option("--sigma-clock", args.sigma_clock_s,
                  "σ of the delay between a head's clock and its pictures [s], counted in every σ (default: exact)")
      ->check(positive_number());
  number("--sigma-angle", args.config.tracker.sigma_encoder_rad, "σ of an encoder of which the rig says none [rad]");
  number("--min-depth", args.config.tracker.min_depth_m, "Working range, nearest [m]");
  number("--max-depth", args.config.tracker.max_depth_m, "Working range, furthest [m]");
  command.add_flag("--skip-bad", args.skip_bad, "Leave out rows that are wrong, by name, instead of stopping");
  add_live_options(command, args.live);
}

}  // namespace

void add_track(App& app) {
  auto args = std::make_shared<TrackArgs>();
  CLI::App& command = app.add_command(
      {.name = "track",
       .summary = "Path of a target in space from the pixels and angles of two or more pan-tilt heads",
       .examples = "alidade track events.csv --rig rig.yaml\n"
                   "alidade track events.csv --rig rig.yaml --method imm --predict 0.1\n"
                   "alidade track events.csv --rig rig.yaml --truth truth.csv --method xiahou2015\n"
                   "alidade track events.csv --rig rig.yaml --intrinsics left/intrinsics.csv right/intrinsics.csv\n"
                   "alidade track --video left.mp4 right.mp4 --angles angles.csv --rate 30 --rig rig.yaml \\\n"
                   "  --target colour:230,70,20\n"},
      [args](Run& run) { return track(*args, run); });
  add_options(command, *args);
}

}  // namespace alidade::cli
