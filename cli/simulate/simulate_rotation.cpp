#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <opencv2/core.hpp>

#include "alidade/formats/camera_file.h"
#include "alidade/images/photos.h"
#include "alidade/imaging/grey_photo.h"
#include "alidade/imaging/image_codecs.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/films/panorama_video.h"
#include "alidade/simulate/rotation.h"
#include "alidade/simulate/turned_scene.h"
#include "alidade/tables/pairs_file.h"
#include "alidade/tables/rotation_log_file.h"
#include "cli/app/app.h"
#include "cli/app/image_size.h"
#include "cli/app/option_checks.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct SimulateRotationArgs {
  std::string size = "780x582", source = "rate", motion = "sway", zoom = "none";
  std::vector<double> k{710.0, 700.0, 390.0, 290.0}, lever, depth;
  double k1 = 0.0, k2 = 0.0, k3 = 0.0, p1 = 0.0, p2 = 0.0, tilt_deg = 0.0, delay_s = 0.0, shutter_s = 0.0,
         clock_rate = 0.0, axes_skew_deg = 0.0;
  double drift_per_s = 0.0, backlash_deg = 0.0;
  std::vector<double> mount_deg, bias, signs, zero_drift, curve_deg;
  RotationFaults faults;
  int points = 4;
  bool video = false, with_range = true;
  std::string photo;
  double photo_deg = 90.0;
  int photos = 0;
  double zoomed = 1.0;
  PanoramaConfig panorama;
  RotationLogConfig config;
};

/// Pan, tilt, roll or rates, over time.
std::function<Eigen::Vector3d(double)> motion_of(const SimulateRotationArgs& args) {
  const bool is_rate = args.source == "rate" && !args.video;  // a video's motion is given by angles
  const Eigen::Vector3d kept = args.motion == "pan"    ? Eigen::Vector3d(is_rate ? 0.0 : 1.0, is_rate ? 1.0 : 0.0, 0.0)
                               : args.motion == "tilt" ? Eigen::Vector3d(is_rate ? 1.0 : 0.0, is_rate ? 0.0 : 1.0, 0.0)
                                                       : Eigen::Vector3d::Ones();
  const double tilt = args.tilt_deg * std::numbers::pi / 180.0;
  if (args.motion == "roll") {
    return [is_rate](double t) {
      return Eigen::Vector3d(0.0, 0.0, is_rate ? 0.2 * std::sin(1.6 * t) : 0.125 * (1.0 - std::cos(1.6 * t)));
    };
  }
  if (args.motion == "still") return [](double) { return Eigen::Vector3d(Eigen::Vector3d::Zero()); };
  if (is_rate) return [kept](double t) { return Eigen::Vector3d(paper_rate(t).cwiseProduct(kept)); };
  return [kept, tilt](double t) {
    return Eigen::Vector3d(paper_pan_tilt(t, 0.0).cwiseProduct(kept) + Eigen::Vector3d(0.0, tilt, 0.0));
  };
}

RotatingIntrinsics intrinsics_at(const SimulateRotationArgs& args, double t_s) {
  RotatingIntrinsics now{args.k[0], args.k[1], args.k[2], args.k[3], args.k1, args.k2, args.k3, args.p1, args.p2};
  now.fx *= 1.0 + args.drift_per_s * t_s;
  now.fy *= 1.0 + args.drift_per_s * t_s;
  if (args.zoom == "sway") {
    now.fx *= 1.0 + 0.15 * std::sin(1.3 * t_s);
    now.fy *= 1.0 + 0.15 * std::sin(1.3 * t_s);
  }
  if (args.zoom == "step" && t_s >= 6.0) {
    now.fx *= 1.1;
    now.fy *= 1.1;
  }
  if (args.zoom == "ramp") {
    const double more = 6.0 * std::clamp(t_s - 6.0, 0.0, 4.0);  // eq. (29): all four by 6 px/s from 6 s to 10 s
    now.fx += more;
    now.fy += more;
    now.cx += more;
    now.cy += more;
  }
  return now;
}

RotationSource source_of(const std::string& word) {
  return word == "rate" ? RotationSource::rate : word == "head" ? RotationSource::head : RotationSource::attitude;
}

std::string truth_yaml(const SimulateRotationArgs& args, const Eigen::Vector4d& k, const RotationScene& scene) {
  Camera camera;
  camera.width_px = scene.width_px;
  camera.height_px = scene.height_px;
  const std::map<std::string, double> bends{
      {"k1", args.k1}, {"k2", args.k2}, {"k3", args.k3}, {"p1", args.p1}, {"p2", args.p2}};
  const bool is_bent = std::any_of(bends.begin(), bends.end(), [](const auto& each) { return each.second != 0.0; });
  camera.lens = *make_lens(is_bent ? "brown" : "pinhole");
  Eigen::VectorXd values = params(camera.lens);
  values.head<4>() = k;
  const auto names = param_names(camera.lens);
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (bends.contains(names[i])) values[static_cast<Eigen::Index>(i)] = bends.at(names[i]);
  }
  camera.lens = with_params(camera.lens, values);
  camera.source = "alidade simulate rotation: true at the end";
  return camera_text(camera, CameraFormat::alidade);
}

FarWorld world_of(const SimulateRotationArgs& args, Run& run) {
  if (args.photo.empty()) return FarWorld::of_noise(3.0 / std::min(args.k[0], args.k[1]), run.options.seed);
  run.add_input("photo", args.photo);
  std::string reason;
  const cv::Mat photo = to_grey_photo(decode_photo(read_file(args.photo), args.photo), reason);
  if (photo.empty()) throw InputError(args.photo + ": is not an image");
  return FarWorld::of_photo(photo, args.photo_deg * std::numbers::pi / 180.0 / photo.cols);
}

RotationFaults faults_of(const SimulateRotationArgs& args) {
  constexpr double degree = std::numbers::pi / 180.0;
  RotationFaults faults = args.faults;
  faults.backlash_rad = args.backlash_deg * degree;
  if (!args.curve_deg.empty()) {
    faults.once_a_turn_rad = args.curve_deg[0] * degree;
    faults.twice_a_turn_rad = args.curve_deg[1] * degree;
  }
  if (!args.zero_drift.empty()) faults.zero_drift_rad_per_s = Eigen::Vector2d(args.zero_drift.data());
  if (!args.signs.empty()) faults.signs = Eigen::Vector2d(args.signs.data());
  return faults;
}

/// Frames as a camera on a head sees them, and the angles it reads: what `observe --video` takes.
ExitCode simulate_video(const SimulateRotationArgs& args, const RotationScene& scene, const RotationLogConfig& config,
                        Run& run) {
  FarWorld world = world_of(args, run);
  RotationLog log = panorama_log(scene, config, run.options.seed);
  const RotationFaults faults = faults_of(args);
  if (faults.are_of_rotation() && log.source != RotationSource::head)
    throw UsageError("errors of the angles are of a head's: --source head");
  if (faults.missing_every > 0 || faults.repeated_every > 0)
    throw UsageError("--missing-every, --repeated-every: of a log of points, without --video");
  add_faults(faults, scene.width_px, scene.height_px, run.options.seed, log);
  PanoramaConfig panorama = args.panorama;
  panorama.moving_share = faults.moving_share;
  for (std::size_t k = 0; k < log.rows.size(); ++k) {
    report_progress(run.progress, "frames", k, log.rows.size());
    run.add_file(fmt::format("frames/{:06}.png", k),
                 png_bytes(render_panorama_frame(world, scene, k, config.rate_hz, panorama, run.options.seed)));
  }
  run.add_file("angles.csv", rotation_log_csv(log));
  run.add_file("truth_camera.yaml", truth_yaml(args, Eigen::Vector4d(log.truth.back().data()), scene));
  run.document.counts.given = run.document.counts.used = log.rows.size();
  Verdict verdict;
  verdict.sentence = fmt::format("{} frames and their angles with known truth", log.rows.size());
  run.say(fmt::format("{} in {}", verdict.sentence, run.options.out.string()));
  return run.finish(verdict);
}

TurnedScene turned_scene_of(const SimulateRotationArgs& args, const RotationScene& scene) {
  TurnedScene turned;
  turned.width_px = scene.width_px;
  turned.height_px = scene.height_px;
  turned.fx = args.k[0];
  turned.fy = args.k[1];
  turned.cx = args.k[2];
  turned.cy = args.k[3];
  turned.k1 = args.k1;
  turned.k2 = args.k2;
  turned.num_photos = args.photos;
  turned.pan_step_rad = 0.4 * scene.width_px / args.k[0];  // six tenths of each photo are the next one's
  turned.tilt_rad = 0.2 * scene.height_px / args.k[1];
  turned.wrong_share = args.faults.wrong_share;
  turned.moving_share = args.faults.moving_share;
  if (args.config.sigma_px > 0.0) turned.sigma_px = args.config.sigma_px;
  if (!args.lever.empty()) turned.lever_m = Eigen::Vector3d(args.lever.data());
  if (!args.depth.empty()) std::tie(turned.min_depth_m, turned.max_depth_m) = std::pair(args.depth[0], args.depth[1]);
  if (args.zoomed != 1.0) {
    turned.zoom.assign(static_cast<std::size_t>(args.photos), 1.0);
    turned.zoom[static_cast<std::size_t>(args.photos) / 2] = args.zoomed;
  }
  return turned;
}

/// Photos of a camera rotated by hand, and matches between them: what `observe PHOTOS` and `--pairs` take. The
/// photos' world is far away and is static; lever, depths, what moves and wrong matches are of pairs.csv.
ExitCode simulate_photos(const SimulateRotationArgs& args, const RotationScene& scene, Run& run) {
  if (args.k3 != 0.0 || args.p1 != 0.0 || args.p2 != 0.0)
    throw UsageError("--k3, --p1 and --p2 are not of --photos, whose matches have k1 and k2");
  const TurnedScene turned = turned_scene_of(args, scene);
  FarWorld world = world_of(args, run);
  const std::vector<Eigen::Quaterniond> attitudes = turned_attitudes(turned, run.options.seed);
  for (std::size_t k = 0; k < attitudes.size(); ++k) {
    report_progress(run.progress, "photos", k, attitudes.size());
    const double zoom = k < turned.zoom.size() ? turned.zoom[k] : 1.0;
    const RotatingIntrinsics intrinsics{zoom * turned.fx, zoom * turned.fy, turned.cx, turned.cy, turned.k1, turned.k2};
    run.add_file(fmt::format("photos/photo{:03}.png", k + 1),
                 png_bytes(render_panorama(world, intrinsics, scene.width_px, scene.height_px, attitudes[k].conjugate(),
                                           args.panorama, run.options.seed + k + 1)));
  }
  run.add_file("pairs.csv", pairs_csv(simulate_turned_photos(turned, run.options.seed)));
  run.add_file("truth_camera.yaml", truth_yaml(args, Eigen::Vector4d(args.k.data()), scene));
  run.document.counts.given = run.document.counts.used = attitudes.size();
  Verdict verdict;
  verdict.sentence = fmt::format("{} photos and matches between them, with known truth", attitudes.size());
  run.say(fmt::format("{} in {}", verdict.sentence, run.options.out.string()));
  return run.finish(verdict);
}

RotationScene scene_of(const SimulateRotationArgs& args, std::uint64_t seed) {
  RotationScene scene;
  std::tie(scene.width_px, scene.height_px) = image_size(args.size);
  if (std::min(scene.width_px, scene.height_px) < 240) throw UsageError("--size: points need 240 px and more");
  scene.start_px = draw_points(scene.width_px, scene.height_px, args.points, seed);
  scene.intrinsics = [&args](double t_s) { return intrinsics_at(args, t_s); };
  scene.motion = motion_of(args);
  scene.delay_s = args.delay_s;
  scene.clock_rate = args.clock_rate;
  scene.axes_skew_rad = args.axes_skew_deg * std::numbers::pi / 180.0;
  scene.shutter_s = args.shutter_s;
  if (!args.mount_deg.empty()) scene.mount_rad = Eigen::Vector3d(args.mount_deg.data()) * std::numbers::pi / 180.0;
  if (!args.lever.empty()) scene.lever_arm_m = Eigen::Vector3d(args.lever.data());
  if (!args.depth.empty()) {
    Draws draws(seed + 1);
    for (int i = 0; i < args.points; ++i) scene.depth_m.push_back(draws.uniform(args.depth[0], args.depth[1]));
  }
  return scene;
}

ExitCode simulate_rotation_log(const SimulateRotationArgs& args, Run& run) {
  const RotationScene scene = scene_of(args, run.options.seed);
  RotationLogConfig config = args.config;
  config.source = source_of(args.source);
  config.with_range = !args.depth.empty() && args.with_range;
  if (!args.bias.empty()) config.rate_bias_rad_per_s = Eigen::Vector3d(args.bias.data());
  if (args.photos > 0) {
    if (args.video) throw UsageError("--photos and --video: one of them");
    return simulate_photos(args, scene, run);
  }
  if (args.zoomed != 1.0) throw UsageError("--zoomed is of --photos");
  if (args.video) {
    if (!args.depth.empty() || !args.lever.empty()) throw UsageError("--video: its world is far away, without --depth");
    return simulate_video(args, scene, config, run);
  }
  RotationLog log = simulate_rotation(scene, config, run.options.seed);
  const RotationFaults faults = faults_of(args);
  if (faults.are_of_rotation() && log.source != RotationSource::head) {
    throw UsageError("errors of the angles are of a head's: --source head");
  }
  add_faults(faults, scene.width_px, scene.height_px, run.options.seed, log);
  run.add_file("log.csv", rotation_log_csv(log));
  run.add_file("truth_camera.yaml", truth_yaml(args, Eigen::Vector4d(log.truth.back().data()), scene));
  run.document.counts.given = run.document.counts.used = log.rows.size();
  Verdict verdict;
  verdict.sentence = fmt::format("{} rows of {} points with known truth", log.rows.size(), args.points);
  run.say(fmt::format("{} in {}", verdict.sentence, (run.options.out / "log.csv").string()));
  return run.finish(verdict);
}

/// What a log may have that is not given.
void add_fault_options(CLI::App& command, SimulateRotationArgs& args) {
  const auto numbers = [&](const char* name, std::vector<double>& values, int count, const char* help) {
    command.add_option(name, values, help)->delimiter(',')->expected(count)->check(finite_number());
  };
  RotationFaults& faults = args.faults;
  add_number(command, "--encoder-scale", faults.angle_scale, "Measured angle / true angle", 0.1, 10.0);
  add_number(command, "--backlash-deg", args.backlash_deg, "Backlash between the encoders and the camera [°]", 0.0,
             10.0);
  numbers("--curve-deg", args.curve_deg, 2,
          "Amplitudes of encoder errors with one and with two periods per revolution [°]");
  add_number(command, "--axes-skew-deg", args.axes_skew_deg,
             "With --source head: rotation of the tilt axis about the optical axis, away from perpendicular to the pan "
             "axis [deg]",
             -10.0, 10.0);
  numbers("--zero-drift", args.zero_drift, 2, "Drift of the encoder zeros of pan, tilt [rad/s]");
  numbers("--signs", args.signs, 2, "Sign of pan and tilt: 1 or -1");
  command.add_flag("--swap-axes", faults.swaps_axes, "Swap pan and tilt");
  numbers("--bias", args.bias, 3, "Bias of the rates x,y,z [rad/s]");
  numbers("--mount-deg", args.mount_deg, 3, "Rotation of the camera on its mount, rotation vector x,y,z [°]");
  add_number(command, "--line-time", args.shutter_s, "Rolling shutter: time from the first row to the last [s]", -0.2,
             0.2);
  add_number(command, "--clock-rate", args.clock_rate,
             "Relative rate error of the image clock against the rotation clock", -0.1, 0.1);
  add_number(command, "--focal-drift", args.drift_per_s, "Relative growth of fx and fy per second", -0.1, 0.1);
  const auto every = [&](const char* name, int& value, const char* help) {
    command.add_option(name, value, help)->check(CLI::Range(0, 100000))->capture_default_str();
  };
  every("--missing-every", faults.missing_every, "Drop every N-th image and number the others consecutively; 0: none");
  every("--repeated-every", faults.repeated_every, "Replace every N-th image by the previous one; 0: none");
  add_number(command, "--wrong", faults.wrong_share,
             "Share of pixels at random positions; in pairs.csv, of wrong matches", 0.0, 0.95);
  add_number(command, "--swapped", faults.swapped_share, "Share of pixels swapped with another point's", 0.0, 0.95);
  add_number(command, "--moving", faults.moving_share,
             "Share of moving points (of those in pairs.csv; with --video, of the image area)", 0.0, 1.0);
  add_number(command, "--lasting-px", faults.noise_px, "Additional time-correlated noise of each track [px]", 0.0,
             100.0);
  add_number(command, "--lasting-s", faults.noise_lasts_s, "Correlation time of that noise [s]", 0.0, 1000.0);
  command.add_flag("!--no-range", args.with_range, "With --depth: omit column range_m");
}

/// How it rotates and zooms, and what it sees.
void add_world_options(CLI::App& command, SimulateRotationArgs& args) {
  const auto word = [&](const char* name, std::string& value, const char* help, std::vector<std::string> words) {
    command.add_option(name, value, help)->check(CLI::IsMember(std::move(words)))->capture_default_str();
  };
  word("--source", args.source, "Measurement of the rotation: rate, head (angles) or attitude",
       {"rate", "head", "attitude"});
  word("--motion", args.motion, "Motion: sway (of the paper, eq. 27), pan, tilt, roll or still",
       {"sway", "pan", "tilt", "roll", "still"});
  word("--zoom", args.zoom, "Zoom: none, ramp (eq. 29), step (+10 % at 6 s) or sway (±15 %, always changing)",
       {"none", "ramp", "step", "sway"});
  command.add_option("--points", args.points, "Number of points")->check(CLI::Range(1, 5000))->capture_default_str();
  command.add_option("--size", args.size, "Image size")->type_name("WxH")->capture_default_str();
  command.add_option("--intrinsics", args.k, "True fx,fy,cx,cy [px]")
      ->delimiter(',')
      ->expected(4)
      ->check(finite_number());
  command
      .add_option("--lever", args.lever, "Position of the camera centre relative to the centre of rotation, x,y,z [m]")
      ->delimiter(',')
      ->expected(3)
      ->check(finite_number());
  command
      .add_option("--depth", args.depth,
                  "Smallest and largest depth of the points [m]; adds column range_m of the first point")
      ->delimiter(',')
      ->expected(2)
      ->check(positive_number());
}

/// Frames and photos instead of points, and how they look.
void add_image_options(CLI::App& command, SimulateRotationArgs& args) {
  command.add_flag("--video", args.video, "Render frames instead of points; writes frames/ and angles.csv");
  command
      .add_option("--photos", args.photos,
                  "Render this many photos of a camera rotated by hand instead, and matches between them; writes "
                  "photos/ and pairs.csv")
      ->check(CLI::Range(2, 200));
  add_number(command, "--zoomed", args.zoomed, "Focal length of the central photo / that of the others", 0.2, 5.0);
  command.add_option("--photo", args.photo, "Photo used as texture of the scene in videos and photos (default: noise)")
      ->type_name("FILE");
  add_number(command, "--photo-deg", args.photo_deg, "Angular width of that photo in the scene [deg]", 1.0, 360.0);
  add_number(command, "--noise", args.panorama.noise, "σ of the grey-level noise of the frames, of 255", 0.0, 100.0);
  add_number(command, "--blur", args.panorama.blur_px, "σ of the optical blur of the frames [px]", 0.0, 20.0);
}

void add_lens_options(CLI::App& command, SimulateRotationArgs& args) {
  add_number(command, "--k1", args.k1, "True lens: k1", -0.4, 0.4);
  add_number(command, "--k2", args.k2, "True lens: k2", -0.4, 0.4);
  add_number(command, "--k3", args.k3, "True lens: k3", -0.4, 0.4);
  add_number(command, "--p1", args.p1, "True lens: p1", -0.05, 0.05);
  add_number(command, "--p2", args.p2, "True lens: p2", -0.05, 0.05);
}

void add_options(CLI::App& command, SimulateRotationArgs& args) {
  add_world_options(command, args);
  add_image_options(command, args);
  add_lens_options(command, args);
  add_fault_options(command, args);
  add_number(command, "--tilt-deg", args.tilt_deg, "With --source head: mean tilt [deg]", -80.0, 80.0);
  add_number(command, "--delay", args.delay_s, "Delay of the pixels against the rotation [s]", -0.5, 0.5);
  add_number(command, "--duration", args.config.duration_s, "Duration of the log [s]", 0.1, 100000.0);
  add_number(command, "--rate", args.config.rate_hz, "Rows per second", 1.0, 10000.0);
  add_number(command, "--sigma-px", args.config.sigma_px, "σ of a pixel coordinate [px]", 0.0, 100.0);
  add_number(command, "--sigma-rate", args.config.sigma_rate_rad_per_s, "σ of a rate [rad/s]", 0.0, 1.0);
  add_number(command, "--sigma-angle", args.config.sigma_angle_rad, "σ of an angle [rad]", 0.0, 1.0);
  add_number(command, "--sigma-range-m", args.config.sigma_range_m, "σ of a range [m]", 0.0, 10.0);
  add_number(command, "--lost", args.config.lost_share, "Share of missing pixels", 0.0, 0.95);
}

}  // namespace

void add_rotation_scenario(App& app) {
  auto args = std::make_shared<SimulateRotationArgs>();
  CLI::App& command = app.add_command(
      {"simulate rotation", "Pixels of static points seen by a rotating camera, its rotation, and ground truth",
       "  alidade simulate rotation --out turn && alidade observe turn/log.csv --size 780x582\n"
       "  alidade simulate rotation --source head --tilt-deg 20 --zoom ramp --k1 -0.2 --out zoom\n"
       "  alidade simulate rotation --video --source head --duration 8 --out film &&\n"
       "    alidade observe --video film/frames --angles film/angles.csv\n"
       "  alidade simulate rotation --photos 9 --wrong 0.2 --out turned && alidade observe turned/photos",
       true},
      [args](Run& run) { return simulate_rotation_log(*args, run); });
  add_options(command, *args);
}

}  // namespace alidade::cli
