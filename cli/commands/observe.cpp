#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "alidade/detect/video_log.h"
#include "alidade/formats/camera_file.h"
#include "alidade/formats/intrinsics_file.h"
#include "alidade/live/streams.h"
#include "alidade/results/observe_document.h"
#include "alidade/tables/rotation_log_file.h"
#include "cli/app/app.h"
#include "cli/app/image_size.h"
#include "cli/app/live.h"
#include "cli/app/option_checks.h"
#include "cli/app/standard_input.h"
#include "cli/commands/commands.h"
#include "cli/commands/observe_photos.h"

namespace alidade::cli {
namespace {

struct ObserveArgs {
  std::vector<std::string> inputs;  ///< A log, or photos.
  std::string log, pairs, video, angles, camera, size, method = "hybrid", rotation = "known";
  double rate_hz = 0.0;
  std::vector<std::string> estimate;
  std::vector<double> start, lever;
  bool skip_bad = false;
  ObserveConfig config;
  LiveOptions live;
};

void estimate_word(const std::string& name, ObserveConfig& config) {
  static const std::map<std::string, bool ObserveNuisances::*> words{
      {"k1", &ObserveNuisances::k1},           {"k2", &ObserveNuisances::k2},
      {"k3", &ObserveNuisances::k3},           {"p1", &ObserveNuisances::tangential},
      {"p2", &ObserveNuisances::tangential},   {"mount", &ObserveNuisances::mount},
      {"delay", &ObserveNuisances::delay},     {"lever", &ObserveNuisances::lever},
      {"shutter", &ObserveNuisances::shutter}, {"focal-drift", &ObserveNuisances::drift}};
  if (name == "none") return;
  if (name == "auto") {
    config.estimate_auto = true;
  } else if (const auto word = words.find(name); word != words.end()) {
    config.estimate.*(word->second) = true;
  } else if (const auto causes = rotation_causes_of(name); !causes.empty()) {
    config.estimate_errors.insert(config.estimate_errors.end(), causes.begin(), causes.end());
  } else {
    throw UsageError("--estimate: '" + name +
                     "' is not auto, none, k1, k2, k3, p1, p2, mount, delay, lever, shutter, focal-drift, scale, "
                     "backlash, curve, drift or bias");
  }
}

void set_words(const ObserveArgs& args, ObserveConfig& config) {
  static const std::map<std::string, ObserveMethod> methods{{"hybrid", ObserveMethod::hybrid},
                                                            {"window", ObserveMethod::window},
                                                            {"flow", ObserveMethod::flow},
                                                            {"fang2011", ObserveMethod::fang2011},
                                                            {"batch", ObserveMethod::batch}};
  static const std::map<std::string, RotationKnowledge> rotations{
      {"known", RotationKnowledge::known}, {"noisy", RotationKnowledge::noisy}, {"free", RotationKnowledge::free}};
  config.method = methods.at(args.method);
  config.rotation = rotations.at(args.rotation);
  for (const std::string& name : args.estimate) estimate_word(name, config);
}

/// Of a lens with its covariance; none: not told. A lens without k1 is one that a board was calibrated with: 0.
std::optional<double> sigma_of_k1(const Camera& camera) {
  if (camera.cov.size() == 0) return std::nullopt;
  const auto names = param_names(camera.lens);
  const auto at = std::find(names.begin(), names.end(), "k1");
  if (at == names.end()) return 0.0;
  const auto i = at - names.begin();
  return std::sqrt(std::max(camera.cov(i, i), 0.0));
}

ObserveConfig config_from(const ObserveArgs& args, const std::optional<Camera>& camera) {
  ObserveConfig config = args.config;
  set_words(args, config);
  if (!args.size.empty()) {
    std::tie(config.width_px, config.height_px) = image_size(args.size);
  } else if (camera) {
    config.width_px = camera->width_px;
    config.height_px = camera->height_px;
  }
  if (camera) {
    config.start = params(camera->lens).head<4>();
    config.lens_is_given = true;
    config.sigma_k1 = sigma_of_k1(*camera);
  }
  if (!args.start.empty()) config.start = Eigen::Vector4d(args.start.data());
  if (config.start && !(config.start->head<2>().minCoeff() > 0.0)) {
    throw UsageError("--start: the focal lengths must be above zero");
  }
  if (!args.lever.empty()) config.lever_m = Eigen::Vector3d(args.lever.data());
  const bool is_regression = config.method == ObserveMethod::flow || config.method == ObserveMethod::fang2011;
  const bool asks = CommonLayout(config.estimate).size > 4 || config.estimate_auto || !config.estimate_errors.empty();
  config.estimate_auto = config.estimate_auto || (args.estimate.empty() && !is_regression);
  if (is_regression && (asks || config.rotation != RotationKnowledge::known)) {
    throw UsageError("--method " + args.method + " knows neither --estimate nor a rotation that is not known");
  }
  return config;
}

/// Points followed through a video. The result tells their log, points.csv, so that it can be looked at and used again.
RotationLog follow_video(const ObserveArgs& args, ObserveConfig& config, Run& run) {
  run.add_input("angles", args.angles);
  const RotationLog angles = read_angles(args.angles);
  VideoFrames video(args.video);
  if (std::filesystem::is_regular_file(args.video)) run.add_input("video", args.video);
  const VideoLog made = log_from_video(video, angles, args.angles, {.rate_hz = args.rate_hz}, run.progress);
  if (config.width_px <= 0) std::tie(config.width_px, config.height_px) = std::pair(made.width_px, made.height_px);
  if (config.width_px != made.width_px || config.height_px != made.height_px) {
    throw InputError(fmt::format("{}: frames are {}x{}, but the camera or --size says {}x{}", args.video, made.width_px,
                                 made.height_px, config.width_px, config.height_px));
  }
  run.say(fmt::format("{} frames, {} points followed, {} used; σ of a pixel {:.2g} px as the tracker sees it",
                      made.num_frames, made.num_tracks, made.log.num_points, made.median_sigma_px));
  run.document.counts.given = made.log.rows.size();
  run.add_file("points.csv", rotation_log_csv(made.log));
  return made.log;
}

RotationLog read_log(const ObserveArgs& args, ObserveConfig& config, Run& run) {
  if (!args.video.empty()) return follow_video(args, config, run);
  run.add_input("log", args.log);
  const RotationLogOptions options{.skip_bad = args.skip_bad, .needs_rotation = args.rotation != "free"};
  RotationLogFile read = read_rotation_log(args.log, options);
  run.document.counts.given = read.skipped.size();
  run.document.counts.skipped = std::move(read.skipped);
  return std::move(read.log);
}

/// Rows for who watches, the last of them in any case.
class RowView {
 public:
  RowView(const ObserveConfig& config, LiveRun& live) : stream_(config.width_px, config.height_px), live_(live) {
    live.open(stream_.topics(), "/observe");
  }
  void show(const RotationLog& log, const IntrinsicsEstimate& estimate, const RotationFrame& frame) {
    if (live_.server() == nullptr) return;
    t_s_ = log.rows.back().t_s;
    truth_ = log.truth.empty() ? std::nullopt : std::optional(log.truth.back());
    estimate_ = estimate;
    frame_ = frame;
    frame_.px = {};  // the row's, which goes
    has_row_ = true;
    send(false);
  }
  void show_last() const {
    if (has_row_) send(true);
  }

 private:
  void send(bool is_last) const {
    stream_.show(*live_.server(), t_s_, estimate_, frame_, truth_ ? &*truth_ : nullptr, is_last);
  }

  live::ObserveStream stream_;
  LiveRun& live_;
  bool has_row_ = false;
  double t_s_ = 0.0;
  IntrinsicsEstimate estimate_;
  RotationFrame frame_;
  std::optional<TrueIntrinsics> truth_;
};

/// Rows from standard input as they come, each answered at once with a row of intrinsics.csv; the log, at its end.
RotationLog follow_input(const ObserveArgs& args, const ObserveConfig& config, const std::optional<Camera>& camera,
                         LiveRun& live, Run& run) {
  if (!config.estimate_errors.empty()) {
    throw UsageError("observe -: errors of the rotation are told from a whole log: keep the rows in a file");
  }
  if (config.width_px <= 0) throw UsageError("observe -: say --size WxH or --camera FILE, the first rows do not tell");
  RowView view(config, live);
  StandardInput input;  // Ctrl-C ends waiting for a row
  RotationLogStream stream(input, "-", {.skip_bad = args.skip_bad});
  RotationLog log = stream.layout();
  ObserveConfig sized = config;
  const PixelScale scale = pixel_scale(log, sized.width_px, sized.height_px);
  HybridObserver observer(hybrid_config(log, config, scale));
  MotionReader reader(log.source, config.max_gap_s);
  const bool shows = !run.options.json && !run.options.quiet;
  if (shows) std::cout << intrinsics_csv({}, {}) << std::flush;
  while (auto entry = stream.next()) {
    report_progress(run.progress, "rows", log.rows.size(), 0);
    log.rows.push_back(std::move(entry->row));
    if (entry->truth) log.truth.push_back(*entry->truth);
    RotationLog one = stream.layout();
    one.rows.push_back(log.rows.back());
    if (camera && !config.estimate.k1) one = undistorted(one, *camera);
    const double t_s = one.rows.front().t_s;
    const RotationFrame frame = reader.next(one.rows.front());
    const IntrinsicsEstimate estimate = observer.step(frame);
    view.show(log, estimate, frame);
    const std::string table = intrinsics_csv({&t_s, 1}, {&estimate, 1});
    if (shows) std::cout << table.substr(table.find('\n') + 1) << std::flush;
  }
  log.sigma_scale = stream.layout().sigma_scale;
  log.sigma_parallax = stream.layout().sigma_parallax;
  view.show_last();
  report_progress(run.progress, "rows", log.rows.size(), 0);  // the input may have ended by Ctrl-C
  run.document.counts.given = stream.skipped().size();
  run.document.counts.skipped = stream.skipped();
  return log;
}

void summarize(const ObserveReport& report, Run& run) {
  for (const ObservedQuantity& quantity : report.quantities) {
    run.say(fmt::format("{:<11} {:.6g} ± {:.2g}   (3σ; this log's bound {:.2g})", quantity.name, quantity.value,
                        3.0 * quantity.sigma, 3.0 * quantity.bound));
  }
  run.say(fmt::format("σ of a pixel {:.3g} px, {}", report.sigma_px,
                      report.sigma_is_told ? "told by the residuals" : "as given"));
  int bursts = 0;
  for (const ObserveNote& note : report.events) {
    if (note.event == ObserveEvent::burst || note.event == ObserveEvent::slip) {
      ++bursts;
    } else {
      run.say(fmt::format("{:8.2f} s  {}", note.t_s, event_name(note.event)));
    }
  }
  if (bursts > 0) run.say(fmt::format("{} frames or points left out that did not fit", bursts));
}

/// Photos, or matches between them: the rotation is what they tell.
TurnedArgs turned_args(const ObserveArgs& args, const std::optional<Camera>& camera) {
  const ObserveConfig config = config_from(args, camera);
  if (config.rotation == RotationKnowledge::noisy) {
    throw UsageError("--rotation noisy: photos and pairs have no measured rotation; leave it out, or say free");
  }
  const ObserveNuisances& asked = config.estimate;
  if (asked.k3 || asked.tangential || asked.mount || asked.delay || asked.lever || config.lever_m) {
    throw UsageError("of photos and pairs, --estimate is auto, none, k1 or k2, and there is no --lever");
  }
  TurnedArgs turned;
  turned.pairs = args.pairs;
  turned.photos.assign(args.inputs.begin(), args.inputs.end());
  turned.skip_bad = args.skip_bad;
  turned.width_px = config.width_px;
  turned.height_px = config.height_px;
  TurnedConfig& to = turned.config;
  to.square_pixels = config.square_pixels;
  to.fixed_centre = config.fixed_centre;
  // what is matched by somebody is of a camera of which nothing is known but what is said
  to.ordinary_aspect = to.ordinary_centre = args.pairs.empty();
  to.start = config.start;
  to.sigma_px = config.sigma_px;
  to.sigma_parallax = config.sigma_parallax;
  if (!args.estimate.empty() && !config.estimate_auto) {
    to.lens_terms = asked.k2 ? 2 : asked.k1 ? 1 : 0;
    to.keeps_terms = true;
  }
  if (camera && !asked.k1 && !asked.k2) turned.lens = camera;
  return turned;
}

void check_sources(ObserveArgs& args) {
  const bool has_photos = args.inputs.size() > 1 || (args.inputs.size() == 1 && is_photo_argument(args.inputs.front()));
  if (!has_photos && !args.inputs.empty()) args.log = std::exchange(args.inputs, {}).front();
  for (const std::string& input : args.inputs) {
    if (!is_photo_argument(input)) throw UsageError("'" + input + "' is no photo: give one log, or photos");
  }
  if (!args.log.empty() + has_photos + !args.pairs.empty() + !args.video.empty() != 1) {
    throw UsageError("give one of a rotation log, photos, --video FILE and --pairs FILE");
  }
  if (args.video.empty() != args.angles.empty()) throw UsageError("--video and --angles go together");
  if (args.video.empty() && args.rate_hz > 0.0) throw UsageError("--rate is for --video");
}

/// Backlash of rates, a scale that is told to be exact: not to be left out silently.
void check_errors(const ObserveArgs& args, const ObserveConfig& config, const RotationLog& log) {
  for (const std::string& word : args.estimate) {
    ObserveConfig one = config;
    one.estimate_errors = rotation_causes_of(word);
    if (one.estimate_errors.empty()) continue;
    if (config.rotation != RotationKnowledge::known) {
      throw UsageError("--estimate " + word + ": is for --rotation known");
    }
    if (!estimated_errors(log, one).empty()) continue;
    one.sigma_scale = 1.0;
    const bool is_told = !estimated_errors(log, one).empty();
    throw UsageError("--estimate " + word +
                     (is_told ? ": the scale is told to be exact: give --sigma-encoder-scale"
                              : ": the rotation of this log has no such error"));
  }
}

ExitCode observe_log(ObserveArgs args, Run& run) {
  check_sources(args);
  std::optional<Camera> camera;
  if (!args.camera.empty()) {
    run.add_input("camera", args.camera);
    camera = read_central_camera(args.camera);
  }
  if (!args.inputs.empty() || !args.pairs.empty()) return observe_photos(turned_args(args, camera), run);
  ObserveConfig config = config_from(args, camera);
  LiveRun live(args.live, run);
  if (live.is_on() && args.log != "-") throw UsageError("--live: only for rows from standard input, observe -");
  RotationLog log = args.log == "-" ? follow_input(args, config, camera, live, run) : read_log(args, config, run);
  if (log.source == RotationSource::none && config.rotation != RotationKnowledge::free) {
    throw InputError(args.log + ": no rotation: omega_x,omega_y or pan,tilt or qw,qx,qy,qz, or say --rotation free");
  }
  if (config.rotation == RotationKnowledge::free) log.source = RotationSource::none;
  check_errors(args, config, log);
  // A lens that is to be estimated is seen as it is.
  const bool lens_is_estimated =
      config.estimate.k1 || config.estimate.k2 || config.estimate.k3 || config.estimate.tangential;
  if (lens_is_estimated) config.lens_is_given = false;
  if (camera && !lens_is_estimated) log = undistorted(log, *camera);
  run.lap("read");
  const ObserveReport report = observe(log, config, run.progress);
  run.lap("observe");
  const Verdict verdict = observe_verdict(report, log, config);
  const Camera seen = observed_camera(report, lens_is_estimated ? std::nullopt : camera);
  fill_observation(log, report, seen, run.document);
  if (has_estimate(verdict)) {
    summarize(report, run);
    run.add_file("camera.yaml", camera_text(seen, CameraFormat::alidade));
  }
  std::vector<double> times;
  for (const RotationRow& row : log.rows) times.push_back(row.t_s);
  run.add_file("intrinsics.csv", intrinsics_csv(times, report.steps));
  return live.finish(verdict);
}

void add_options(CLI::App& command, ObserveArgs& args) {
  command.add_option(
      "log", args.inputs,
      "Rotation log, CSV: t, the rotation, p1x,p1y,p2x,p2y,…; - reads rows from standard input and answers each. Or "
      "photos, or folders of them, of a camera that was turned on the spot");
  command
      .add_option("--pairs", args.pairs,
                  "Points matched between photos instead, of which many may be wrong, CSV: frame_a,frame_b,ua_px,…")
      ->type_name("FILE");
  command
      .add_option("--video", args.video, "Video file or folder of numbered frames instead: points are followed in it")
      ->type_name("FILE|DIR");
  command.add_option("--angles", args.angles, "How the camera turned in the video, CSV: t, the rotation")
      ->type_name("FILE");
  command
      .add_option("--rate", args.rate_hz, "Frames a second, first at t = 0 (default: the angles have a row a frame)")
      ->check(positive_number());
  command.add_option("--method", args.method, "hybrid, window, flow, fang2011 or batch")
      ->check(CLI::IsMember({"hybrid", "window", "flow", "fang2011", "batch"}))
      ->capture_default_str();
  command
      .add_option("--rotation", args.rotation, "known: exact; noisy: measured with --sigma-angle or --sigma-rate; free")
      ->check(CLI::IsMember({"known", "noisy", "free"}))
      ->capture_default_str();
  command
      .add_option("--estimate", args.estimate,
                  "Estimated as well: auto (default: what the residuals ask for), none, or of k1, k2, k3, p1, p2, "
                  "mount, delay, lever, shutter, focal-drift, and of the rotation scale, backlash, curve, drift, bias")
      ->delimiter(',');
  command.add_option("--camera", args.camera, "Where to start, and the lens' distortion")->type_name("FILE");
  command.add_option("--start", args.start, "Where to start: fx,fy,cx,cy [px]; without it several are tried")
      ->delimiter(',')
      ->expected(4)
      ->check(finite_number());
  command.add_option("--size", args.size, "Size of the picture (default: what holds the points)")->type_name("WxH");
  command.add_option("--profile", args.config.profile, "Gains of --method fang2011")
      ->check(CLI::IsMember({"fast", "quiet", "kalman"}))
      ->capture_default_str();
  command.add_flag("--square-pixels", args.config.square_pixels, "fx = fy");
  command.add_flag("--no-zoom", args.config.no_zoom, "The camera does not zoom: what seems a zoom is something else");
  command.add_flag("--fix-centre", args.config.fixed_centre, "cx, cy: the start's, or the picture's middle");
  command.add_option("--lever", args.lever, "Camera centre from the centre of rotation, x,y,z in the camera frame [m]")
      ->delimiter(',')
      ->expected(3)
      ->check(finite_number());
  const auto sigma = [&](const char* name, double& value, const char* help) {
    command.add_option(name, value, help)->check(positive_number());
  };
  sigma("--sigma-px", args.config.sigma_px, "σ of a pixel coordinate [px] (default: told by the residuals)");
  sigma("--sigma-angle", args.config.sigma_angle_rad, "σ of an encoder or attitude angle [rad]");
  sigma("--sigma-rate", args.config.sigma_rate_rad_per_s, "σ of a rate [rad/s]");
  sigma("--sigma-range-m", args.config.sigma_range_m, "σ of the column range_m [m]");
  const auto sigma_of_given = [&](const char* name, std::optional<double>& value, const char* help) {
    command.add_option(name, value, help)->check(CLI::Range(0.0, 1.0));
  };
  sigma_of_given("--sigma-encoder-scale", args.config.sigma_scale,
                 "σ of the scale of the measured angles or rates, as a share; 0: exact");
  sigma_of_given("--sigma-parallax", args.config.sigma_parallax,
                 "σ of how far the camera centre is from the axes, over the distance of the points; 0: exact");
  sigma("--window-s", args.config.window_s, "Length of --method window");
  command.add_flag("--skip-bad", args.skip_bad, "Leave out rows that are wrong, by name, instead of stopping");
  add_live_options(command, args.live, false);
}

}  // namespace

void add_observe(App& app) {
  auto args = std::make_shared<ObserveArgs>();
  CLI::App& command = app.add_command(
      {.name = "observe",
       .summary = "Intrinsics of a camera that pans, tilts and zooms, from what it sees while it turns",
       .examples =
           "alidade observe log.csv --size 780x582\n"
           "alidade observe log.csv --camera prior.yaml --estimate k1,mount,delay\n"
           "alidade observe --video ptz.mp4 --angles encoder.csv --rate 30\n"
           "alidade observe log.csv --method fang2011 --profile quiet --start 500,510,400,300\n"
           "alidade observe photos/*.jpg --rotation free\n"
           "alidade observe --pairs matches.csv --rotation free --square-pixels --fix-centre --size 1280x960\n"},
      [args](Run& run) { return observe_log(*args, run); });
  add_options(command, *args);
}

}  // namespace alidade::cli
