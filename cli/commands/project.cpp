#include "alidade/project.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <opencv2/core.hpp>

#include "alidade/formats/beam_file.h"
#include "alidade/formats/camera_file.h"
#include "alidade/formats/rig_file.h"
#include "alidade/images/photos.h"
#include "alidade/results/project_outcome.h"
#include "cli/app/app.h"
#include "cli/app/option_checks.h"
#include "cli/commands/camera_values.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct ProjectArgs {
  std::filesystem::path beam, camera, overlay, rig;
  std::vector<double> ranges_m, pans_rad, tilts_rad;
  std::vector<double> point_m;  ///< Empty, or x, y, z in the world.
  ProjectConfig config;
};

cv::Mat overlay_photo(const std::filesystem::path& file, const Camera& camera, Run& run) {
  const std::string bytes = read_file(file);
  run.add_input("photo", file.string(), bytes);
  cv::Mat photo = decode_photo(bytes, file.string());
  if (photo.cols != camera.width_px || photo.rows != camera.height_px)
    throw InputError(fmt::format("{}: is {}x{}, the camera is for {}x{}", file.string(), photo.cols, photo.rows,
                                 camera.width_px, camera.height_px));
  return photo;
}

ExitCode project_beam(ProjectArgs args, Run& run) {
  run.add_input("beam", args.beam);
  const BeamFile file = read_beam(args.beam);
  const std::filesystem::path camera_file = args.camera.empty() ? file.camera : args.camera;
  if (camera_file.empty()) throw UsageError("the beam names no camera; say --camera FILE");
  add_camera_input(run, camera_file);
  const Camera camera = read_central_camera(camera_file);
  if (!file.camera.empty() && file.camera != camera_file && std::filesystem::exists(file.camera)) {
    args.config.own_camera = read_central_camera(file.camera);
    args.config.own_camera_name = file.camera.string();
  }
  const BeamProjection result = project_readings(file.beam, camera, args.ranges_m, args.config);
  JobOutcome outcome = outcome_of(result);
  if (!args.overlay.empty()) {
    add_overlay(result, overlay_photo(args.overlay, camera, run), outcome);
    outcome.lines.push_back("overlay: " + (run.options.out / "overlay.png").string());
  }
  return run.finish(std::move(outcome));
}

ExitCode project_heads(const ProjectArgs& args, Run& run) {
  const Rig rig = read_rig(args.rig);
  add_rig_input(run, args.rig);
  add_rig_doubts(run, rig);
  if (!rig.intrinsics_histories.empty())
    throw InputError(args.rig.string() + ": intrinsics: change with time, which `project` is not given; give a camera");
  std::optional<Eigen::Vector3d> point_in_world;
  if (!args.point_m.empty()) point_in_world = Eigen::Vector3d(args.point_m.data());
  return run.finish(outcome_of(alidade::project_rig(rig, args.pans_rad, args.tilts_rad, point_in_world)));
}

/// Which of the two it is, and whether its options are there.
ExitCode run_project(const ProjectArgs& args, Run& run) {
  if (!args.rig.empty()) {
    if (!args.beam.empty() || !args.ranges_m.empty()) throw UsageError("--rig and --beam are two different questions");
    if (args.pans_rad.empty() || args.tilts_rad.empty()) throw UsageError("--rig needs --pan and --tilt");
    return project_heads(args, run);
  }
  if (args.beam.empty()) throw UsageError("give --beam FILE with --range, or --rig FILE with --pan and --tilt");
  if (args.ranges_m.empty()) throw UsageError("--beam needs --range");
  if (!args.pans_rad.empty() || !args.tilts_rad.empty() || !args.point_m.empty())
    throw UsageError("--pan, --tilt and --point belong to --rig");
  return project_beam(args, run);
}

}  // namespace

void add_project(App& app) {
  auto args = std::make_shared<ProjectArgs>();
  CLI::App& command = app.add_command(
      {.name = "project",
       .summary = "Pixel and 3-D point of a rangefinder reading, or projection matrices and pixels of a pan-tilt rig",
       .examples = "alidade project --beam rangefinder.yaml --camera camera.yaml --range 2.31\n"
                   "alidade project --beam rangefinder.yaml --range 0.5,1,2,4 --overlay photo.jpg\n"
                   "alidade project --rig rig.yaml --pan 0.1,-0.2 --tilt 0.2 --point 0.1 -0.3 2.5\n"},
      [args](Run& run) { return run_project(*args, run); });
  command.add_option("--beam", args->beam, "Beam, rangefinder.yaml as written by alidade rangefinder")
      ->type_name("FILE");
  command.add_option("--camera", args->camera, "Camera file (default: the one named in the beam file)")
      ->type_name("FILE");
  command.add_option("--range", args->ranges_m, "Range reading, or several [m]")
      ->delimiter(',')
      ->check(positive_number());
  command.add_option("--overlay", args->overlay, "Draw the beam and the spots into this photo; writes overlay.png")
      ->type_name("PHOTO");
  command.add_option("--rig", args->rig, "Rig, rig.yaml as written by alidade rig")->type_name("FILE");
  command.add_option("--pan", args->pans_rad, "Pan encoder readings, one for all heads or one per head [rad]")
      ->delimiter(',')
      ->check(finite_number());
  command.add_option("--tilt", args->tilts_rad, "Tilt encoder readings, likewise [rad]")
      ->delimiter(',')
      ->check(finite_number());
  command
      .add_option("--point", args->point_m, "Point X Y Z in the rig's world frame [m]; prints its pixel in each camera")
      ->expected(3)
      ->check(finite_number());
  app.add_fields(command, fields_of(args->config));
}

}  // namespace alidade::cli
