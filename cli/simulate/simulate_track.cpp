#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <memory>
#include <opencv2/core.hpp>

#include "alidade/detect/video_observations.h"
#include "alidade/formats/rig_file.h"
#include "alidade/imaging/image_codecs.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/films/target_video.h"
#include "alidade/simulate/track.h"
#include "alidade/tables/events_file.h"
#include "alidade/tables/servo_scenario_file.h"
#include "cli/app/app.h"
#include "cli/app/option_checks.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

constexpr double longest_s = 3600.0;

struct SimulateTrackArgs {
  std::string scenario = "B", path;
  bool video = false;
  double clutter = 0.0;
  double duration_s = 0.0;
  std::vector<std::string> faults;
  double latency_ms = -1.0, lag_s = -1.0, sigma_px = 0.5, sigma_angle = 0.0008726646259971648;
};

/// The σ_a that a filter should be given for a recorded target: nearly the largest acceleration over a tenth of a
/// second, in which the record's own jitter is small.
double usual_acceleration(const TrackScene& scene) {
  constexpr double step_s = 0.1, nearly_all = 0.9;
  std::vector<double> all{0.0};
  const double until_s = std::min(scene.duration_s, longest_s);
  for (double t_s = step_s; t_s + step_s <= until_s; t_s += step_s) {
    const Eigen::Vector3d bend =
        scene.position(t_s + step_s) - 2.0 * scene.position(t_s) + scene.position(t_s - step_s);
    all.push_back(bend.norm() / (step_s * step_s));
  }
  const auto at = static_cast<std::ptrdiff_t>(nearly_all * static_cast<double>(all.size() - 1));
  std::ranges::nth_element(all, all.begin() + at);
  return std::max(all[static_cast<std::size_t>(at)], 0.01);
}

/// The heads of the scenario watch a target that went where a file says.
void follow_record(const std::string& file, TrackScene& scene) {
  const TargetPath path = read_recorded_path(file);
  scene.name += " along " + file;
  scene.position = [path](double t_s) { return path.at(path.recorded_s.front() + t_s); };
  scene.duration_s = path.recorded_s.back() - path.recorded_s.front();
  scene.sigma_a_m_s2 = usual_acceleration(scene);
}

const char* const fault_help =
    "Deviation from rig.yaml, NAME or NAME:SIZE; of head 2 unless named: yaw, pitch, roll (of its base, rad), baseline "
    "(relative), pan_zero1, pan_zero2, tilt_zero1, tilt_zero2 (rad), clock (s), time_step (times of all heads rounded "
    "down to it, s), clutter (share of the observations), second_target (share of the observations), swapped (heads), "
    "mirrored, mirrored_all (all heads), pan_sign, tilt_sign, milliseconds (all times in ms), milliseconds2 (those of "
    "head 2); rig.yaml is then not marked exact";

std::optional<double> number_of(const std::string& text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

/// One --fault, put into the scene's.
void add_fault(const std::string& text, TrackFaults& faults) {
  const std::size_t colon = text.find(':');
  const std::string name = text.substr(0, colon);
  const std::map<std::string, bool*> flags{{"swapped", &faults.swapped},
                                           {"mirrored", &faults.mirrored},
                                           {"mirrored_all", &faults.mirrored_all},
                                           {"milliseconds", &faults.milliseconds},
                                           {"milliseconds2", &faults.milliseconds_of_one},
                                           {"pan_sign", &faults.pan_sign},
                                           {"tilt_sign", &faults.tilt_sign}};
  if (const auto flag = flags.find(name); flag != flags.end() && colon == std::string::npos) {
    *flag->second = true;
    return;
  }
  const std::map<std::string, std::pair<double*, double>> sizes{{"pitch", {&faults.base_turn_rad.x(), 1.0}},
                                                                {"yaw", {&faults.base_turn_rad.y(), 1.0}},
                                                                {"roll", {&faults.base_turn_rad.z(), 1.0}},
                                                                {"baseline", {&faults.baseline, 0.9}},
                                                                {"pan_zero1", {&faults.zero_rad[0].x(), 1.0}},
                                                                {"pan_zero2", {&faults.zero_rad[1].x(), 1.0}},
                                                                {"tilt_zero1", {&faults.zero_rad[0].y(), 1.0}},
                                                                {"tilt_zero2", {&faults.zero_rad[1].y(), 1.0}},
                                                                {"clock", {&faults.clock_s, 1.0}},
                                                                {"time_step", {&faults.time_step_s, 1.0}},
                                                                {"clutter", {&faults.clutter, 1.0}},
                                                                {"second_target", {&faults.second, 1.0}}};
  const auto found = sizes.find(name);
  const std::string number = colon == std::string::npos ? "" : text.substr(colon + 1);
  const auto size = number_of(number);
  if (found == sizes.end() || !size || !(std::abs(*size) <= found->second.second))
    throw UsageError(fmt::format("--fault: '{}' is not NAME or NAME:SIZE, size at most 1; see --help", text));
  if ((name == "clutter" || name == "second_target" || name == "time_step") && *size < 0.0)
    throw UsageError(fmt::format("--fault: '{}' is below 0", text));
  *found->second.first = *size;
}

TrackScene scene_of(const SimulateTrackArgs& args) {
  auto scene = track_scenario(args.scenario);
  if (!scene)
    throw UsageError(
        fmt::format("--scenario: '{}' is not one of {}", args.scenario, fmt::join(track_scenarios(), ", ")));
  if (!args.path.empty()) follow_record(args.path, *scene);
  if (args.latency_ms >= 0.0) scene->latency_s = 1e-3 * args.latency_ms;
  if (args.duration_s > 0.0) scene->duration_s = args.duration_s;
  if (scene->duration_s > longest_s)
    throw InputError(
        fmt::format("{}: lasts {:g} s; give --duration, at most {:g} s", args.path, scene->duration_s, longest_s));
  if (args.lag_s >= 0.0) scene->aiming_lag_s = args.lag_s;
  for (const std::string& fault : args.faults) add_fault(fault, scene->faults);
  scene->sigma_px = args.sigma_px;
  scene->sigma_encoder_rad = args.sigma_angle;
  for (RigHead& head : scene->heads) head.head.encoder.sigma_rad = args.sigma_angle;
  return *scene;
}

TrueTrack truth_of(const TrackScene& scene) {
  TrueTrack truth;
  constexpr double rate_hz = 200.0;
  const double until_s = scene.duration_s + 1.0;  // so that predictions can be judged as well
  for (int k = 0; k <= static_cast<int>(until_s * rate_hz); ++k) {
    truth.t_s.push_back(k / rate_hz);
    truth.position.push_back(scene.position(k / rate_hz));
  }
  return truth;
}

/// Frames of both heads and the angles they read: what `track --video` takes. Images are taken at the true angles.
std::size_t add_frames(const TrackScene& scene, double sigma_encoder_rad, double clutter, Run& run) {
  HeadAngles angles;
  angles.logs.resize(scene.heads.size());
  Draws draws(run.options.seed);
  const auto observations = simulate_track(scene, run.options.seed);
  for (std::size_t k = 0; k < observations.size(); ++k) {
    report_progress(run.progress, "frames", k, observations.size());
    const SimulatedObservation& observation = observations[k];
    const RigHead& head = scene.heads[observation.head];
    const cv::Mat frame = render_target_frame(head, observation.pan_tilt_rad, scene.position(observation.t_capture_s),
                                              {}, {.clutter = clutter}, run.options.seed + k);
    auto& rows = angles.logs[observation.head].rows;
    run.add_file(fmt::format("head_{}/{:06}.png", head.head.id, rows.size()), png_bytes(frame));
    const Eigen::Vector2d read = observation.pan_tilt_rad + sigma_encoder_rad * draws.normal2();
    RotationRow row;
    row.t_s = observation.t_capture_s;
    row.pan_tilt_roll_rad << read, 0.0;
    rows.push_back(row);
  }
  run.add_file("angles.csv", head_angles_csv(angles, scene.heads));
  return observations.size();
}

std::size_t add_events(const TrackScene& scene, Run& run) {
  std::vector<TargetObservation> observations;
  for (const SimulatedObservation& s : simulate_track(scene, run.options.seed))
    observations.push_back({s.t_capture_s, s.t_arrival_s, s.head, s.pan_tilt_rad, s.px});
  run.add_file("events.csv", events_csv(observations, scene.heads));
  return observations.size();
}

/// The simulated heads are exactly what the file says, and it says so.
Rig exact_rig(const std::vector<RigHead>& heads) {
  Rig rig;
  rig.heads = heads;
  const auto num = num_head_params * static_cast<Eigen::Index>(heads.size());
  rig.cov.setZero(num, num);
  for (RigHead& head : rig.heads) {
    const Eigen::Index size = params(head.camera.lens).size();
    head.camera.cov.setZero(size, size);
  }
  return rig;
}

ExitCode simulate_track_events(const SimulateTrackArgs& args, Run& run) {
  TrackScene scene = scene_of(args);
  if (!args.path.empty()) run.add_input("path", args.path);
  if (args.video && !args.faults.empty()) throw UsageError("--fault: not with --video");
  if (!args.video && args.clutter > 0.0)
    throw UsageError("--clutter: is for --video; --fault clutter:SHARE for observations");
  if (args.video) scene.sigma_encoder_rad = 0.0;
  const std::size_t num_observations =
      args.video ? add_frames(scene, args.sigma_angle, args.clutter, run) : add_events(scene, run);
  run.add_file("truth.csv", true_track_csv(truth_of(scene)));
  Rig rig = exact_rig(scene.heads);
  if (!args.faults.empty()) {
    rig = {};
    rig.heads = scene.heads;
  }
  run.add_file("rig.yaml", rig_text(rig));
  run.document.estimate["sigma_a_m_s2"] = scene.sigma_a_m_s2;
  run.document.estimate["duration_s"] = scene.duration_s;
  run.document.counts.given = run.document.counts.used = num_observations;
  Verdict verdict;
  verdict.sentence = fmt::format("scenario {}: {} {} of two heads with known truth", scene.name, num_observations,
                                 args.video ? "frames" : "sights");
  run.say(fmt::format("{} in {}", verdict.sentence, run.options.out.string()));
  return run.finish(verdict);
}

}  // namespace

void add_track_scenario(App& app) {
  auto args = std::make_shared<SimulateTrackArgs>();
  CLI::App& command = app.add_command(
      {"simulate track", "Observations of a moving target by two pan-tilt heads, and its true path",
       "  alidade simulate track --scenario C --out sim && alidade track sim/events.csv --rig sim/rig.yaml \\\n"
       "    --truth sim/truth.csv\n"
       "  alidade simulate track --scenario B --latency-ms 100 --out late\n"
       "  alidade simulate track --scenario B --fault clock:0.03 --fault clutter:0.05 --out faulty\n"
       "  alidade simulate track --scenario G --path recorded.csv --out real\n"
       "  alidade simulate track --scenario B --video --duration 3 --out film && alidade track --video film/head_1 \\\n"
       "    film/head_2 --angles film/angles.csv --rig film/rig.yaml --look colour:230,70,20 --truth film/truth.csv",
       true},
      [args](Run& run) { return simulate_track_events(*args, run); });
  command
      .add_option("--scenario", args->scenario,
                  "A: slow circle; A2: likewise, heads with offsets and rotated mountings; B: fast circle; C: "
                  "manoeuvre; D: C, hidden for a while; E: B, images 100 ms late; F: C, images 100 ms late; G: C, 20 "
                  "and 30 images per second; throw: ball thrown up and caught; bounce: bouncing ball")
      ->capture_default_str();
  command.add_option("--path", args->path,
                     "Target path to use instead of the scenario's, CSV from its first row: t_s,x_m,y_m,z_m; after the "
                     "last row the target rests");
  const auto number = [&](const char* name, double& value, const char* help, double low, double high) {
    return command.add_option(name, value, help)->check(number_within(low, high));
  };
  command.add_flag("--video", args->video,
                   "Render frames instead of observations; writes head_1/, head_2/ and angles.csv");
  number("--clutter", args->clutter,
         "With --video: contrast of coloured patches behind the target, σ of a colour value, of 255", 0.0, 100.0);
  number("--duration", args->duration_s, "Duration [s] (default: the scenario's, or the path's)", 0.1, longest_s);
  number("--latency-ms", args->latency_ms, "Latency from capture to arrival [ms] (default: the scenario's)", 0.0,
         10000.0);
  number("--lag-s", args->lag_s, "Time constant of the heads [s] (default: 0.34; scenario throw: 0.05)", 0.0, 10.0);
  command.add_option("--fault", args->faults, fault_help)->type_name("NAME:SIZE");
  number("--sigma-px", args->sigma_px, "σ of the target's pixel coordinates [px]", 0.0, 100.0)->capture_default_str();
  number("--sigma-angle", args->sigma_angle, "σ of an encoder reading [rad]", 0.0, 1.0)->capture_default_str();
}

}  // namespace alidade::cli
