#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <memory>
#include <opencv2/core.hpp>

#include "alidade/detect/image_sequence.h"
#include "alidade/formats/camera_file.h"
#include "alidade/images/photos.h"
#include "alidade/live/foxglove.h"
#include "alidade/live/rate_limit.h"
#include "alidade/live/streams.h"
#include "alidade/localize/distortion.h"
#include "alidade/localize/localize_images.h"
#include "alidade/results/localize_document.h"
#include "alidade/results/seen_frames.h"
#include "alidade/tables/localize_file.h"
#include "cli/app/app.h"
#include "cli/app/live.h"
#include "cli/app/option_checks.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct LocalizeArgs {
  std::filesystem::path sequence, camera, target, start, truth;
  std::string distortion = "full", new_points = "inverse-depth";
  double rate_hz = 0.0, depth_m = 0.0, sigma_depth = 0.5;
  double sigma_px = 0.0, sigma_scale = 0.0;  ///< 0: not told.
  bool calibrate_online = false, skip_bad = false;
  LocalizationFilterConfig filter;
  LiveOptions live;
};

/// Of the lens's parameters that may be in the state: what is believed of them at the start. A stale calibration.
struct OnlineParameter {
  const char* name;
  double sigma;
};
constexpr std::array<OnlineParameter, 8> online{
    {{"fx", 8.0}, {"fy", 8.0}, {"cx", 6.0}, {"cy", 6.0}, {"k1", 0.05}, {"k2", 0.1}, {"p1", 0.02}, {"p2", 0.02}}};

std::vector<std::string> put_lens_in_state(const Camera& camera, LocalizationFilterConfig& filter) {
  std::vector<std::string> chosen;
  const std::vector<std::string> names = param_names(camera.lens);
  for (std::size_t i = 0; i < names.size(); ++i) {
    for (const OnlineParameter& parameter : online) {
      if (names[i] != parameter.name) continue;
      const auto at = static_cast<Eigen::Index>(i);
      const bool has_sigma = camera.cov.rows() > at && camera.cov(at, at) > 0.0;
      filter.lens_params.push_back(static_cast<int>(i));
      filter.sigma_lens_params.push_back(has_sigma ? std::sqrt(camera.cov(at, at)) : parameter.sigma);
      chosen.push_back(names[i]);
    }
  }
  return chosen;
}

Camera camera_of(const LocalizeArgs& args) {
  const auto camera = with_distortion(read_camera(args.camera), *distortion_variant(args.distortion));
  if (!camera) throw UsageError("--distortion: only a brown lens can be given less than full distortion");
  return *camera;
}

double now_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

LocalizeConfig config_of(const LocalizeArgs& args) {
  LocalizeConfig config;
  config.filter = args.filter;
  if (args.sigma_px > 0.0 && !ImageSequence::is_images(args.sequence)) config.filter.sigma_px = args.sigma_px;
  config.depth_m = args.depth_m;
  config.sigma_depth = args.sigma_depth;
  config.new_points = args.new_points == "xyz"       ? NewPoints::xyz
                      : args.new_points == "delayed" ? NewPoints::delayed
                                                     : NewPoints::inverse_depth;
  if (!args.target.empty() && !ImageSequence::is_images(args.sequence)) {
    const TargetFile target = read_target_file(args.target);
    config.target = target.points;
    config.is_board = target.is_board;
    config.seen_from_plus_z = target.seen_from_plus_z;
    config.sigma_scale = args.sigma_scale > 0.0 ? args.sigma_scale : target.sigma_scale;
    config.is_scale_told = target.is_scale_told || args.sigma_scale > 0.0;
  }
  if (!args.start.empty()) {
    const StartFile start = read_start(args.start);
    config.start = start.start;
    config.depths = start.depths;
    if (start.depth_m > 0.0 && !(args.depth_m > 0.0)) {
      config.depth_m = start.depth_m;
      config.sigma_depth = start.sigma_depth;
    }
  }
  config.seconds = now_s;
  return config;
}

void add_inputs(const LocalizeArgs& args, Run& run) {
  if (!std::filesystem::is_directory(args.sequence)) run.add_input("sequence", args.sequence);
  run.add_input("camera", args.camera);
  if (!args.target.empty()) run.add_input("target", args.target);
  if (!args.start.empty()) run.add_input("start", args.start);
  if (!args.truth.empty()) run.add_input("truth", args.truth);
}

void summarize(const LocalizeReport& report, std::span<const std::string> lens_params, Run& run) {
  if (report.path.empty() || !report.path.back().has_pose()) return;
  const PathStep& last = report.path.back();
  const Eigen::Vector<double, 6> sigma = last.cov.diagonal().cwiseSqrt();
  run.say(fmt::format("{} frames, {} lost; {} points in the map; at the end within ± {:.2g} m, ± {:.2g}° (3σ)",
                      report.path.size(), report.num_lost, report.map.size(), 3.0 * sigma.head<3>().maxCoeff(),
                      3.0 * sigma.tail<3>().maxCoeff() * 57.29577951308232));
  if (std::isfinite(report.nis_per_dof)) run.say(fmt::format("NIS per degree of freedom {:.2f}", report.nis_per_dof));
  if (std::isfinite(report.error.ate_m))
    run.say(fmt::format("against the truth: ATE {:.4g} m ({} alignment), RPE {:.4g} m a frame", report.error.ate_m,
                        report.scale_known ? "SE(3)" : "Sim(3)", report.error.rpe_m));
  const std::vector<std::string> names = param_names(report.camera.lens);
  const Eigen::VectorXd values = params(report.camera.lens);
  for (std::size_t k = 0; k < lens_params.size(); ++k) {
    const auto at = std::ranges::find(names, lens_params[k]) - names.begin();
    run.say(fmt::format("{} {:.6g} ± {:.2g}", lens_params[k], values[at],
                        3.0 * report.sigma_lens[static_cast<Eigen::Index>(k)]));
  }
}

LocalizeReport localize_table(const LocalizeArgs& args, const Camera& camera, const LocalizeConfig& config,
                              std::span<const TimedPose> truth, LiveRun& live, Run& run) {
  const ObservationsFile observations =
      read_observations(args.sequence, {args.skip_bad, args.rate_hz, camera.width_px, camera.height_px});
  run.lap("read");
  run.document.counts.given = observations.skipped.size();
  run.document.counts.skipped = observations.skipped;
  return localize_observations(camera, observations.frames, config, truth, live.progress());
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

LocalizeReport localize_images(const LocalizeArgs& args, const Camera& camera, const LocalizeConfig& localize,
                               std::span<const TimedPose> truth, LiveRun& live, Run& run) {
  LocalizeImagesConfig config;
  config.localize = localize;
  config.localize.sigma_scale = args.sigma_scale;
  if (args.sigma_px > 0.0) config.eyes.sigma_floor_px = args.sigma_px;
  if (!args.target.empty()) config.target = read_image_target(args.target);
  ImageSequence images(args.sequence, args.rate_hz, camera.width_px, camera.height_px);
  double image_s = 0.0;
  const NextImage next = [&](cv::Mat& grey, long& frame, double& t_s) {
    const bool is_there = images.next(grey, frame, t_s);
    image_s = t_s;
    return is_there;
  };
  live::RateLimit limit(10.0);
  SeenFrames seen(images.num_images(), !run.options.no_report);
  config.watch = [&](long, const cv::Mat& image, std::span<const ObservationTried> tried) {
    seen.offer(image_s, image, tried);
    if (live.server() != nullptr && limit.lets_through(now_s())) show_image(*live.server(), image_s, image, tried);
  };
  LocalizeReport report = localize_images(camera, next, images.num_images(), config, truth, live.progress());
  seen.fill(run.document);
  for (const auto& [name, jpeg] : seen.images()) run.add_image(name, jpeg);
  return report;
}

LocalizeReport localized(const LocalizeArgs& args, const Camera& camera, LocalizeConfig config,
                         std::span<const TimedPose> truth, const live::LocalizeStream& stream, LiveRun& live,
                         Run& run) {
  if (live.is_on()) {
    live.open(stream.topics(), "/localize");
    stream.begin(*live.server());
    config.watch = [&](const PathStep& step) {
      live.keep_pace(step.t_s);
      stream.show(*live.server(), step);
    };
  }
  LocalizeReport report = ImageSequence::is_images(args.sequence)
                              ? localize_images(args, camera, config, truth, live, run)
                              : localize_table(args, camera, config, truth, live, run);
  if (live.server() != nullptr && !report.path.empty()) stream.show(*live.server(), report.path.back(), true);
  return report;
}

ExitCode localize(const LocalizeArgs& args, Run& run) {
  add_inputs(args, run);
  const Camera camera = camera_of(args);
  LocalizeConfig config = config_of(args);
  std::vector<std::string> lens_params;
  if (args.calibrate_online) lens_params = put_lens_in_state(camera, config.filter);
  std::vector<TimedPose> truth;
  if (!args.truth.empty()) truth = read_tum(args.truth);
  const live::LocalizeStream stream(camera, truth);
  LiveRun live(args.live, run);
  const LocalizeReport report = localized(args, camera, config, truth, stream, live, run);
  run.lap("localize");
  const Verdict verdict = localize_verdict(report);
  fill_localization(report, truth, lens_params, run.document);
  run.document.assumed = localize_assumed(report);
  summarize(report, lens_params, run);
  if (has_estimate(verdict)) {
    std::vector<TimedPose> path;
    for (const PathStep& step : report.path)
      if (step.has_pose()) path.push_back({step.t_s, step.world_from_cam});
    run.add_file("trajectory.tum", tum_text(path));
    run.add_file("poses.csv", poses_csv(report.path));
    run.add_file("map.csv", map_csv(report.map));
    run.add_file("map.ply", map_ply(report.map));
    if (args.calibrate_online) run.add_file("camera.yaml", camera_text(report.camera, CameraFormat::alidade));
  }
  return live.finish(verdict);
}

void add_options(CLI::App& command, LocalizeArgs& args) {
  command
      .add_option("sequence", args.sequence,
                  "Pictures: a folder of numbered ones, EuRoC's layout (mav0/cam0), or a video; or sights of numbered "
                  "points, CSV: frame,t_s,point_id,u_px,v_px, in order of time")
      ->required();
  command.add_option("--camera", args.camera, "The camera, calibrated in the water it is used in")
      ->type_name("FILE")
      ->required();
  command
      .add_option("--target", args.target,
                  "What gives scale and the map's frame (target.yaml): known points; in pictures a rectangle, a "
                  "board, or points with patches")
      ->type_name("FILE");
  command
      .add_option("--start", args.start, "Where the camera starts, how fast, how sure; depths of points (start.yaml)")
      ->type_name("FILE");
  command.add_option("--truth", args.truth, "True path as TUM (t x y z qx qy qz qw); adds ATE and RPE")
      ->type_name("FILE");
  command.add_option("--rate", args.rate_hz, "Frames a second: times are frame numbers over this")
      ->check(positive_number());
  command.add_option("--distortion", args.distortion, "How much of a brown lens's distortion the filter knows")
      ->check(CLI::IsMember({"none", "radial1", "full"}))
      ->capture_default_str();
  command.add_flag("--calibrate-online", args.calibrate_online,
                   "Estimate fx fy cx cy k1 k2 p1 p2 as well, from the camera file's values and σ on");
  command
      .add_option("--new-points", args.new_points,
                  "How a new point enters: inverse-depth, xyz, or delayed until its depth is known to 5 %")
      ->check(CLI::IsMember({"inverse-depth", "xyz", "delayed"}))
      ->capture_default_str();
  const auto number = [&](const char* name, double& value, const char* help) {
    return command.add_option(name, value, help)->check(positive_number());
  };
  number("--depth", args.depth_m, "Depth at which a new point is first believed [m] (default: the target's)");
  number("--sigma-depth", args.sigma_depth, "σ of that over the depth")->capture_default_str();
  number(
      "--sigma-px", args.sigma_px,
      "σ of a pixel coordinate (default 0.5); in pictures, where each match brings its own, the least (default 0.11) "
      "[px]");
  number("--sigma-scale", args.sigma_scale, "σ of the target's size over it, as of a print (0.002: 0.2 %), counted");
  number("--sigma-a", args.filter.sigma_a_m_s2, "Acceleration of the camera [m/s2]; by hand about 4")
      ->capture_default_str();
  number("--sigma-alpha", args.filter.sigma_alpha_rad_s2, "Angular acceleration [rad/s2]; by hand about 6")
      ->capture_default_str();
  command.add_flag("--skip-bad", args.skip_bad, "Leave out rows that are wrong, by name, instead of stopping");
  add_live_options(command, args.live);
}

}  // namespace

void add_localize(App& app) {
  auto args = std::make_shared<LocalizeArgs>();
  CLI::App& command = app.add_command(
      {.name = "localize",
       .summary = "Path of a moving camera, and the map of the points it sees, with the lens in the filter",
       .examples = "alidade localize frames/ --camera camera.yaml --target rectangle.yaml --rate 30 --sigma-a 4 "
                   "--sigma-alpha 6\n"
                   "alidade localize sights.csv --camera camera.yaml --target target.yaml\n"
                   "alidade localize sights.csv --camera camera.yaml --target target.yaml --calibrate-online\n"
                   "alidade localize sights.csv --camera camera.yaml --start start.yaml --truth truth.tum\n"},
      [args](Run& run) { return localize(*args, run); });
  add_options(command, *args);
}

}  // namespace alidade::cli
