#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <opencv2/core.hpp>

#include "alidade/formats/camera_file.h"
#include "alidade/imaging/image_codecs.h"
#include "alidade/simulate/films/underwater_video.h"
#include "alidade/simulate/imu/imu_readings.h"
#include "alidade/simulate/underwater.h"
#include "alidade/tables/localize_file.h"
#include "cli/app/app.h"
#include "cli/app/option_checks.h"
#include "cli/commands/camera_values.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct SimulateUnderwaterArgs {
  UnderwaterScene scene;
  std::filesystem::path camera;
  double rate_hz = 10.0;
  double given_f = 1.0, given_centre_px = 0.0;
  bool given_k1 = true;
  bool video = false;
  double imu_hz = 0.0;  ///< 0: no IMU.
  ImuScene imu;
  UnderwaterVideoConfig look;
};

LocalizeStart start_of(const UnderwaterScene& scene, const UnderwaterSequence& sequence) {
  LocalizeStart start;
  start.motion.world_from_cam = sequence.given_start;
  const std::array<double, 4> sigmas{scene.sigma_position_m, scene.sigma_rotation_rad, 0.3, 0.3};
  for (std::size_t i = 0; i < sigmas.size(); ++i)
    start.cov.diagonal().segment<3>(static_cast<Eigen::Index>(3 * i)).setConstant(sigmas[i] * sigmas[i]);
  for (const UnderwaterPoint& point : sequence.points)
    if (!point.is_known && point.given_depth_m > 0.0)
      start.depths.push_back({point.id, point.given_depth_m, scene.sigma_depth});
  return start;
}

/// What `localize` takes of observations; how many there are.
std::size_t add_observations(const UnderwaterScene& scene, const UnderwaterSequence& sequence, Run& run) {
  std::vector<ObservationFrame> frames;
  std::size_t num_observations = 0;
  for (const UnderwaterFrame& frame : sequence.frames) {
    ObservationFrame seen{static_cast<long>(frames.size()), frame.t_s, {}};
    for (const UnderwaterObservation& observation : frame.observations)
      seen.observations.push_back({observation.id, observation.px, 0.0});
    num_observations += seen.observations.size();
    frames.push_back(std::move(seen));
  }
  std::vector<KnownPoint> target;
  for (const UnderwaterPoint& point : sequence.points)
    if (point.is_known) target.push_back({point.id, point.given_in_world, scene.sigma_known_m});
  run.add_file("sights.csv", observations_csv(frames));
  run.add_file("target.yaml", target_text(target));
  run.add_file("start.yaml", start_text(start_of(scene, sequence)));
  return num_observations;
}

/// What `localize` takes of images: the board itself is the target.
std::size_t add_frames(const SimulateUnderwaterArgs& args, const Camera& camera, const UnderwaterSequence& sequence,
                       Run& run) {
  for (std::size_t k = 0; k < sequence.frames.size(); ++k) {
    report_progress(run.progress, "frames", k, sequence.frames.size());
    const cv::Mat frame =
        render_underwater_frame(camera, sequence.frames[k].world_from_cam, args.look, run.options.seed + k);
    run.add_file(fmt::format("frames/{:06}.png", k), png_bytes(frame));
  }
  const Board board = underwater_board();
  run.add_file("target.yaml",
               fmt::format("board: {{corners: {}x{}, square_m: {}}}\n", board.cols, board.rows, board.square_m));
  return sequence.frames.size();
}

/// An IMU's readings from half a second before the first frame to half a second after the last, with their truth.
void add_imu(const SimulateUnderwaterArgs& args, const UnderwaterSequence& sequence, Run& run) {
  ImuScene scene = args.imu;
  scene.rate_hz = args.imu_hz;
  constexpr double around_s = 0.5;
  const ImuSequence imu = simulate_imu(scene, sequence.world_from_cam, -around_s, sequence.frames.back().t_s + around_s,
                                       run.options.seed + 1000003);
  run.add_file("imu.csv", imu_csv(imu.readings));
  run.add_file("imu.yaml", imu_mounting_text(scene.mounting));
  std::string truth =
      "t_s,rate_bias_x,rate_bias_y,rate_bias_z,force_bias_x,force_bias_y,force_bias_z,gravity_x,"
      "gravity_y,gravity_z,late_s\n";
  for (const std::size_t i : {std::size_t{0}, imu.readings.size() - 1}) {
    truth += fmt::format("{:.9f}", imu.readings[i].t_s);
    for (const Eigen::Vector3d& each : {imu.rate_bias[i], imu.force_bias[i], scene.gravity_in_world})
      truth += fmt::format(",{:.9g},{:.9g},{:.9g}", each.x(), each.y(), each.z());
    truth += fmt::format(",{:.9g}\n", scene.late_s);
  }
  run.add_file("truth_imu.csv", truth);
}

/// The camera as given in camera.yaml.
Camera given_camera(const SimulateUnderwaterArgs& args, const Camera& camera) {
  Camera given = camera;
  Eigen::VectorXd values = params(camera.lens);
  const std::vector<std::string> names = param_names(camera.lens);
  for (std::size_t i = 0; i < names.size(); ++i) {
    double& value = values[static_cast<Eigen::Index>(i)];
    if (names[i] == "fx" || names[i] == "fy") value *= args.given_f;
    if (names[i] == "cx") value += args.given_centre_px;
    if (names[i] == "k1" && !args.given_k1) value = 0.0;
  }
  given.lens = with_params(camera.lens, values);
  return given;
}

ExitCode simulate(const SimulateUnderwaterArgs& args, Run& run) {
  UnderwaterScene scene = args.scene;
  scene.camera = args.camera.empty() ? underwater_camera() : read_camera_input(run, args.camera);
  scene.dt_s = 1.0 / args.rate_hz;
  const UnderwaterSequence sequence = simulate_underwater(scene, run.options.seed);
  std::vector<TimedPose> truth;
  for (const UnderwaterFrame& frame : sequence.frames) truth.push_back({frame.t_s, sequence.world_from_cam(frame.t_s)});
  std::vector<MapPoint> map;
  for (const UnderwaterPoint& point : sequence.points)
    map.push_back({point.id, point.point_in_world, Eigen::Matrix3d::Zero(), point.is_known, 0});
  const std::size_t num =
      args.video ? add_frames(args, scene.camera, sequence, run) : add_observations(scene, sequence, run);
  run.add_file("camera.yaml", camera_text(given_camera(args, scene.camera), CameraFormat::alidade));
  if (args.imu_hz > 0.0) add_imu(args, sequence, run);
  run.add_file("truth.tum", tum_text(truth));
  run.add_file("truth_map.csv", map_csv(map));
  run.document.estimate["frames"] = sequence.frames.size();
  run.document.counts.given = run.document.counts.used = num;
  Verdict verdict;
  verdict.sentence = args.video ? fmt::format("{} images of a board under water, with known truth", num)
                                : fmt::format("{} frames with {} observations of {} points, with known truth",
                                              sequence.frames.size(), num, sequence.points.size());
  run.say(fmt::format("{} in {}", verdict.sentence, run.options.out.string()));
  return run.finish(verdict);
}

/// What is not as given.
void add_mistakes(CLI::App& command, SimulateUnderwaterArgs& args, CLI::Option* video) {
  UnderwaterScene& scene = args.scene;
  const char* const group = "Simulated faults";
  add_number(command, "--told-f", args.given_f, "Focal length in camera.yaml / true focal length", 0.1, 10.0)
      ->group(group);
  add_number(command, "--told-centre", args.given_centre_px, "cx in camera.yaml minus the true one [px]", -500.0, 500.0)
      ->group(group);
  command.add_flag("!--no-k1", args.given_k1, "Omit k1 from camera.yaml")->group(group);
  add_number(command, "--readout", scene.readout_s, "Rolling shutter: time from the first row to the last [s]", 0.0,
             1.0)
      ->excludes(video)
      ->group(group);
  add_number(command, "--late", scene.late_s, "Images are taken this long before their timestamps [s]", -10.0, 10.0)
      ->excludes(video)
      ->group(group);
  command
      .add_option("--missing-every", scene.missing_every,
                  "Drop every N-th frame and number the others consecutively; 0: none")
      ->check(CLI::Range(0, 100000))
      ->capture_default_str()
      ->group(group);
  add_number(command, "--target-speed", scene.target_speed_m_s,
             "Speed of the board along its x axis against the other points [m/s]", -1.0, 1.0)
      ->excludes(video)
      ->group(group);
  add_number(command, "--target-stretch", scene.target_stretch, "Relative stretch of the points in target.yaml along x",
             -0.5, 0.5)
      ->excludes(video)
      ->group(group);
}

/// What is seen, and how well.
CLI::Option* add_scene(CLI::App& command, SimulateUnderwaterArgs& args) {
  UnderwaterScene& scene = args.scene;
  command.add_option("--camera", args.camera, "True camera (default: one with strong distortion)")->type_name("FILE");
  command.add_option("--frames", scene.num_frames, "Number of frames")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  CLI::Option* points =
      command.add_option("--points", scene.num_points, "Number of points: the board's 8, then others")
          ->check(CLI::Range(1, 1000))
          ->capture_default_str();
  command.add_option("--rate", args.rate_hz, "Frame rate [Hz]")->check(positive_number())->capture_default_str();
  CLI::Option* video = command.add_flag(
      "--video", args.video, "Render images of the board through turbid water instead of observations; writes frames/");
  add_number(command, "--blur-px", args.look.blur_px, "With --video: σ of the blur [px]", 0.0, 10.0)->needs(video);
  add_number(command, "--noise", args.look.noise, "With --video: σ of the noise of a colour value, of 255", 0.0, 100.0)
      ->needs(video);
  points->excludes(video);
  add_number(command, "--sigma-px", scene.sigma_px, "σ of a pixel coordinate [px]", 0.0, 100.0)->excludes(video);
  add_number(command, "--sigma-depth", scene.sigma_depth, "Relative σ of the depths in start.yaml", 0.0, 1.0)
      ->excludes(video);
  return video;
}

}  // namespace

void add_underwater_scenario(App& app) {
  auto args = std::make_shared<SimulateUnderwaterArgs>();
  CLI::App& command = app.add_command(
      {"simulate underwater", "Observations of a board and points around it by an underwater camera, and its true path",
       "  alidade simulate underwater --out sim && alidade localize sim/sights.csv --camera sim/camera.yaml \\\n"
       "    --target sim/target.yaml --start sim/start.yaml --truth sim/truth.tum\n"
       "  alidade simulate underwater --points 40 --frames 300 --rate 30 --mismatches 0.4 --out hard\n"
       "  alidade simulate underwater --video --rate 30 --frames 90 --out film && alidade localize film/frames \\\n"
       "    --rate 30 --camera film/camera.yaml --target film/target.yaml --truth film/truth.tum",
       true},
      [args](Run& run) { return simulate(*args, run); });
  UnderwaterScene& scene = args->scene;
  CLI::Option* video = add_scene(command, *args);
  add_number(command, "--imu", args->imu_hz,
             "Rate of an IMU beside the camera [Hz]; writes imu.csv and its mounting imu.yaml; 0: none", 10.0, 10000.0);
  add_number(command, "--imu-late", args->imu.late_s, "Clock offset of the IMU: its time minus the camera's [s]", -10.0,
             10.0);
  add_number(command, "--mismatches", scene.mismatches, "Share of the observations that belong to another point", 0.0,
             1.0)
      ->excludes(video);
  add_number(command, "--blackout-from", scene.blackout_from_s, "Start of a time in which nothing is seen [s]", 0.0,
             1e6)
      ->excludes(video);
  add_number(command, "--blackout", scene.blackout_s, "Duration of that time [s]", 0.0, 1e6)->excludes(video);
  add_mistakes(command, *args, video);
}

}  // namespace alidade::cli
