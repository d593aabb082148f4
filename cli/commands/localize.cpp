#include "alidade/localize.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <opencv2/core.hpp>

#include "alidade/detect/image_sequence.h"
#include "alidade/formats/beam_file.h"
#include "alidade/formats/camera_file.h"
#include "alidade/images/photos.h"
#include "alidade/live/foxglove.h"
#include "alidade/live/rate_limit.h"
#include "alidade/live/streams.h"
#include "alidade/results/localize_outcome.h"
#include "alidade/results/seen_frames.h"
#include "alidade/tables/localize_file.h"
#include "alidade/tables/map_file.h"
#include "cli/app/app.h"
#include "cli/app/live.h"
#include "cli/app/truth_times.h"
#include "cli/commands/camera_values.h"
#include "cli/commands/commands.h"
#include "cli/commands/localize_epoch.h"
#include "cli/commands/localize_live.h"

namespace alidade::cli {
namespace {

struct LocalizeArgs {
  std::filesystem::path sequence;
  std::string camera, target, start, truth, depth_sensor, range, beam, odometry, imu, imu_mounting, mask, map;  // files
  Imu imu_values;  ///< Of what `imu` reads.
  std::optional<double> rate_hz, wait_s;
  bool skip_bad = false;
  std::vector<SkippedInput> skipped;  ///< Of the sensors' files.
  LocalizeConfig config;
  LiveOptions live;

  [[nodiscard]] bool is_input() const { return sequence == "-"; }
  [[nodiscard]] bool is_mask_file() const { return !mask.empty() && mask != "circle" && mask != "auto"; }
  [[nodiscard]] bool is_images() const { return !is_input() && is_image_sequence(sequence); }
};

/// What is known of an IMU's errors.
FieldList fields_of(Imu& imu) {
  constexpr Limits positive{.min = 0.0, .is_above_min = true};
  ImuNoise& noise = imu.noise;
  return {
      {.name = "gyro_noise",
       .value = &noise.rate_density,
       .help = "Noise density of the gyroscope of --imu [rad/s/√Hz]",
       .limits = positive},
      {.name = "accelerometer_noise",
       .value = &noise.force_density,
       .help = "Noise density of the accelerometer of --imu [m/s²/√Hz]",
       .limits = positive},
      {.name = "gyro_walk",
       .value = &noise.rate_walk,
       .help = "Random walk of the gyroscope's bias [rad/s²/√Hz]",
       .limits = positive},
      {.name = "accelerometer_walk",
       .value = &noise.force_walk,
       .help = "Random walk of the accelerometer's bias [m/s³/√Hz]",
       .limits = positive},
      {.name = "sigma_accelerometer_scale",
       .value = &noise.sigma_force_scale,
       .help = "Relative σ of the accelerometer's common scale factor (0.003: 0.3 %)",
       .limits = positive},
      {.name = "sigma_imu_axes",
       .value = &noise.sigma_axes,
       .help = "Relative σ of axis scale differences and misalignment in either sensor (0.01: 1 %)",
       .limits = positive},
      {.name = "gravity_m_s2",
       .value = &imu.gravity_m_s2,
       .help = "Magnitude of gravity, known to 0.02 m/s²",
       .limits = {9.7, 9.9},
       .option = "--gravity"},
  };
}

/// What is localised in, and where it is shown.
FieldList frame_fields(LocalizeArgs& args) {
  return {
      {.name = "camera",
       .value = &args.camera,
       .help = "Camera file, calibrated in the medium it is used in (air or water)",
       .form = "FILE",
       .is_required = true},
      {.name = "target",
       .value = &args.target,
       .help = "Known target that fixes scale and map frame (target.yaml): known points, or, in images, a rectangle, a "
               "board or points with patches",
       .form = "FILE",
       .old_options = {"--landmarks"}},
      {.name = "map",
       .value = &args.map,
       .help = "Map saved by an earlier run (map.yaml), used instead of a target: the path starts once the map is "
               "recognised, in its frame and scale; matched by appearance in images, by point number in tables",
       .form = "FILE"},
      {.name = "start",
       .value = &args.start,
       .help = "Initial pose and velocity of the camera with σ, and point depths (start.yaml)",
       .form = "FILE"},
      {.name = "mask",
       .value = &args.mask,
       .help = "Mask image of the camera's size, black where the scene is not visible; 'circle': "
               "circular view, as of an endoscope, found in the first image that shows one; 'auto': excludes what "
               "stays still while the scene moves, such as a burnt-in clock",
       .form = "FILE|circle|auto"},
  };
}

/// Readings beside the images.
FieldList sensor_fields(LocalizeArgs& args) {
  return {
      {.name = "depth_sensor",
       .value = &args.depth_sensor,
       .help = "Depth of the camera, up to an offset, CSV: t_s,depth_m[,sigma_m]; gives metric scale without a target, "
               "else checks its scale",
       .form = "FILE"},
      {.name = "range",
       .value = &args.range,
       .help =
           "Readings of a rangefinder beside the camera, CSV: t_s,range_m; give metric scale without a target, else "
           "check its scale; needs --beam",
       .form = "FILE"},
      {.name = "beam",
       .value = &args.beam,
       .help = "Beam of the rangefinder in the camera frame (rangefinder.yaml, as written by alidade rangefinder)",
       .form = "FILE"},
      {.name = "odometry",
       .value = &args.odometry,
       .help = "Positions by vehicle odometry, CSV: t_s,x_m,y_m[,z_m], in its own frame: lengths travelled give metric "
               "scale without a target, else check its scale",
       .form = "FILE"},
      {.name = "imu",
       .value = &args.imu,
       .help = "Readings of an IMU fixed to the camera, CSV: "
               "t_s,omega_x_rad_s,omega_y_rad_s,omega_z_rad_s,force_x_m_s2,force_y_m_s2,force_z_m_s2 (at rest +9.81 "
               "upwards), or EuRoC's imu0/data.csv, in its own axes: give metric scale and gravity direction without a "
               "target, else check its scale",
       .form = "FILE"},
      {.name = "imu_mounting",
       .value = &args.imu_mounting,
       .help = "Mounting of the IMU, cam_from_imu: translation_m and quaternion_wxyz, or Kalibr's T_cam_imu (default: "
               "rotation estimated from the motion, position within 0.1 m of the camera)",
       .form = "FILE"},
  };
}

FieldList fields_of(LocalizeArgs& args) {
  FieldList fields = frame_fields(args);
  const auto append = [&](const FieldList& more) { fields.insert(fields.end(), more.begin(), more.end()); };
  append(sensor_fields(args));
  append({
      {.name = "truth",
       .value = &args.truth,
       .help = "True trajectory in TUM format (t x y z qx qy qz qw); adds ATE and RPE",
       .form = "FILE"},
      {.name = "rate_hz",
       .value = &args.rate_hz,
       .help = "Frame rate [Hz]: time = frame number / rate (default: timestamps of the video)",
       .limits = {.min = 0.0, .is_above_min = true}},
  });
  append({{.name = "wait_s",
           .value = &args.wait_s,
           .help = "For a folder that another program is still writing to: stop when no new image has arrived for this "
                   "long [s]; poses are printed as they come",
           .limits = {.min = 0.0, .is_above_min = true}}});
  append(alidade::fields_of(args.config));
  append(fields_of(args.imu_values));
  fields.push_back(
      {.name = "skip_bad", .value = &args.skip_bad, .help = "Skip invalid rows, naming each, instead of stopping"});
  return fields;
}

double now_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

ImageMask read_mask(const std::filesystem::path& file) {
  const cv::Mat photo = decode_photo(read_file(file), file.string());
  std::vector<cv::Mat> channels;
  cv::split(photo, channels);
  const cv::Mat is_shown = channels.front() > 0;
  ImageMask mask{is_shown.cols, is_shown.rows, {}};
  mask.shows.assign(is_shown.begin<std::uint8_t>(), is_shown.end<std::uint8_t>());
  return mask;
}

/// Reads the files that the config takes values from.
void read_values(LocalizeArgs& args) {
  if (!args.target.empty())
    args.config.target = args.is_images() ? read_image_target(args.target) : read_target(args.target);
  if (!args.map.empty() && !args.target.empty())
    throw UsageError("--map and --target both say the map's frame: give one of them");
  if (!args.map.empty()) args.config.map = read_map(args.map);
  if (!args.start.empty()) args.config.start = read_start(args.start);
  if (args.range.empty() != args.beam.empty()) throw UsageError("--range and --beam belong together: give both");
  if (args.depth_sensor.empty() && (args.config.depth_arm_m || args.config.sigma_depth_arm_m))
    throw UsageError("--depth-arm and --sigma-depth-arm need --depth-sensor");
  if (!args.depth_sensor.empty())
    args.config.depth_readings = read_depth_sensor(args.depth_sensor, args.skip_bad, &args.skipped);
  if (!args.odometry.empty())
    args.config.odometry_readings = read_odometry(args.odometry, args.skip_bad, &args.skipped);
  if (args.imu.empty() && !args.imu_mounting.empty()) throw UsageError("--imu-mounting needs --imu");
  if (!args.imu.empty()) {
    args.config.imu = args.imu_values;
    const std::int64_t origin_ns = args.is_images() ? origin_ns_of(args.sequence) : 0;
    args.config.imu->readings = read_imu(args.imu, args.skip_bad, &args.skipped, origin_ns);
    if (!args.imu_mounting.empty()) args.config.imu->mounting = read_imu_mounting(args.imu_mounting);
  }
  if (!args.range.empty()) args.config.range_readings = read_ranges(args.range, args.skip_bad, &args.skipped);
  if (args.wait_s && !args.is_images()) throw UsageError("--wait needs a folder of images; it may still be empty");
  if (!args.mask.empty() && !args.is_images())
    throw UsageError("--mask is of images; a table of observations has none");
  args.config.masks_circle = args.mask == "circle";
  args.config.masks_still = args.mask == "auto";
  if (args.is_mask_file()) args.config.mask = read_mask(args.mask);
  if (!args.beam.empty()) args.config.beam = read_beam(args.beam).beam;
  args.config.seconds = now_s;
}

void add_inputs(const LocalizeArgs& args, Run& run) {
  if (!args.is_input() && !std::filesystem::is_directory(args.sequence)) run.add_input("sequence", args.sequence);
  add_camera_input(run, args.camera);
  if (!args.target.empty()) run.add_input("target", args.target);
  if (!args.map.empty()) run.add_input("map", args.map);
  if (!args.start.empty()) run.add_input("start", args.start);
  if (args.is_mask_file()) run.add_input("mask", args.mask);
  if (!args.depth_sensor.empty()) run.add_input("depth sensor", args.depth_sensor);
  if (!args.range.empty()) run.add_input("range", args.range);
  if (!args.beam.empty()) run.add_input("beam", args.beam);
  if (!args.odometry.empty()) run.add_input("odometry", args.odometry);
  if (!args.imu.empty()) run.add_input("IMU", args.imu);
  if (!args.imu_mounting.empty()) run.add_input("IMU mounting", args.imu_mounting);
  if (!args.truth.empty()) run.add_input("truth", args.truth);
}

/// An image with what was looked for in it, as wide as a page needs.
void show_image(live::Server& server, double t_s, const cv::Mat& image, std::span<const ObservationTried> tried) {
  constexpr int max_width_px = 640;
  const double scale = std::min(1.0, static_cast<double>(max_width_px) / image.cols);
  const auto t_ns = static_cast<std::int64_t>(t_s * 1e9);
  server.send("/head1/image", t_ns, [t_ns, copy = image.clone()] {
    return live::compressed_image_text(t_ns, "head1", jpeg_preview(copy, max_width_px, 70));
  });
  live::Marks marks(t_ns);
  for (const ObservationTried& observation : tried) {
    marks.ellipse(scale * observation.expected_px, scale * scale * observation.S, live::sky);
    if (observation.found_px)
      marks.dot(scale * *observation.found_px, 4.0, observation.is_used ? live::orange : live::vermilion);
  }
  server.send("/head1/marks", t_ns, [text = marks.text()] { return text; });
}

ObservationsOptions reading(const LocalizeArgs& args, const Camera& camera) {
  return {args.skip_bad, args.rate_hz.value_or(0.0), camera.width_px, camera.height_px};
}

Localization localize_table(const LocalizeArgs& args, const Camera& camera, std::span<const TimedPose> truth,
                            LiveRun& live, Run& run) {
  const ObservationTable observations = read_observations(args.sequence, reading(args, camera));
  run.lap("read");
  return alidade::localize(observations, camera, args.config, truth, live.progress());
}

Localization localize_images(LocalizeArgs args, const FrameByFrame& given, std::optional<SeenFrames>& seen) {
  const double rate_hz = args.rate_hz.value_or(0.0);
  ImageStream images;
  if (!args.wait_s) images = images_in(args.sequence, given.camera, rate_hz);
  live::RateLimit limit(10.0);
  seen.emplace(images.num_images, !given.run.options.no_report);
  args.config.watch_image = [&](double t_s, const cv::Mat& image, std::span<const ObservationTried> tried) {
    seen->offer(t_s, image, tried);
    if (given.server != nullptr && limit.lets_through(now_s())) show_image(*given.server, t_s, image, tried);
  };
  if (!args.wait_s) return alidade::localize(images, given.camera, args.config, given.truth, given.progress);
  const FrameByFrame watched{given.camera, args.config,    given.truth, given.is_up_to_scale,
                             given.server, given.progress, given.run};
  return localize_growing(args.sequence, rate_hz, *args.wait_s, watched);
}

/// A truth of other times, or of fewer poses than can be aligned, is refused.
void require_same_times(const std::filesystem::path& file, const Localization& result) {
  constexpr std::size_t fewest = 3;
  const auto num_posed = static_cast<std::size_t>(
      std::ranges::count_if(result.path, [](const PathStep& step) { return step.has_pose(); }));
  const std::size_t num_pairs = result.error.num_pairs;
  if (result.truth.empty() || num_pairs >= fewest || num_posed < fewest) return;
  throw truth_of_other_times(
      file, {result.truth.front().t_s, result.truth.back().t_s}, {result.path.front().t_s, result.path.back().t_s},
      fmt::format("{} of {} frames have a pose of their time in it, {} are needed", num_pairs, num_posed, fewest));
}

/// Where there is a truth and no ATE: why.
void note_unaligned(const Localization& result, JobOutcome& outcome) {
  if (result.error.num_pairs == 0 || std::isfinite(result.error.ate_m)) return;
  outcome.lines.push_back(
      "against the truth: no ATE, as positions at fewer than three times, or along one line, are not aligned");
}

ExitCode run_localize(LocalizeArgs args, Run& run) {
  add_inputs(args, run);
  const Camera camera = read_camera(args.camera);
  read_values(args);
  std::vector<TimedPose> truth;
  if (!args.truth.empty()) truth = read_tum(args.truth);
  const std::int64_t origin_ns = args.is_images() ? origin_ns_of(args.sequence) : 0;
  from_epoch(origin_ns, truth);
  const live::LocalizeStream stream(camera, truth);
  LiveRun live(args.live, run);
  if (live.is_on()) {
    live.open(stream.topics(), "/localize");
    stream.begin(*live.server());
    args.config.watch = [&](const PathStep& step) {
      live.keep_pace(step.t_s);
      stream.show(*live.server(), step);
    };
  }
  std::optional<SeenFrames> seen;
  const bool is_up_to_scale = args.target.empty() && args.map.empty() && args.start.empty();
  const Progress progress = args.is_input() ? run.progress : live.progress();
  const FrameByFrame given{camera, args.config, truth, is_up_to_scale, live.server(), progress, run};
  const Localization result = args.is_input()    ? localize_input(reading(args, camera), given)
                              : args.is_images() ? localize_images(args, given, seen)
                                                 : localize_table(args, camera, truth, live, run);
  if (live.server() != nullptr && !result.path.empty()) stream.show(*live.server(), result.path.back(), true);
  run.lap("localize");
  if (is_estimate(static_cast<int>(result.verdict.exit_code))) require_same_times(args.truth, result);
  JobOutcome outcome = outcome_of(result);
  note_unaligned(result, outcome);
  to_epoch(origin_ns, result, outcome);
  add_skipped(args.skipped, outcome);
  if (seen) seen->add_to(outcome);
  return live.finish(std::move(outcome));
}

}  // namespace

void add_localize(App& app) {
  auto args = std::make_shared<LocalizeArgs>();
  CLI::App& command = app.add_command(
      {.name = "localize",
       .summary = "Trajectory of a moving camera and a map of the points it sees (visual SLAM), with the lens model in "
                  "the filter",
       .examples = "alidade localize frames/ --camera camera.yaml --target rectangle.yaml --rate 30 --sigma-a 4 "
                   "--sigma-alpha 6\n"
                   "alidade localize sights.csv --camera camera.yaml --target target.yaml\n"
                   "alidade localize sights.csv --camera camera.yaml --target target.yaml --calibrate-online\n"
                   "  tracker | alidade localize - --camera camera.yaml --target target.yaml\n"
                   "  recorder frames/ & alidade localize frames/ --camera camera.yaml --rate 30 --wait 5\n"
                   "alidade localize later/ --camera camera.yaml --map alidade-out/localize/map.yaml --rate 30\n"
                   "alidade localize sights.csv --camera camera.yaml --start start.yaml --truth truth.tum\n"
                   "alidade localize sights.csv --camera camera.yaml --depth-sensor depth.csv\n"
                   "alidade localize sights.csv --camera camera.yaml --range ranges.csv --beam rangefinder.yaml\n"
                   "alidade localize sights.csv --camera camera.yaml --imu imu.csv --imu-mounting imu.yaml\n",
       .writes_at_end = true},
      [args](Run& run) { return run_localize(*args, run); });
  command
      .add_option("sequence", args->sequence,
                  "Images: folder of numbered frames, EuRoC layout (mav0/cam0) or video; or observations of numbered "
                  "points, CSV: frame,t_s,point_id,u_px,v_px, in time order; -: read these rows from standard input "
                  "and print the filter's pose of each frame; --imu, --depth-sensor, --range and --odometry then only "
                  "count in the path solved at the end")
      ->required();
  app.add_fields(command, fields_of(*args));
  add_live_options(command, args->live);
}

}  // namespace alidade::cli
