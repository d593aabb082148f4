#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <numbers>
#include <opencv2/core.hpp>

#include "alidade/formats/camera_file.h"
#include "alidade/formats/camera_json.h"
#include "alidade/imaging/image_codecs.h"
#include "alidade/simulate/boards/board_photos.h"
#include "alidade/simulate/example_camera.h"
#include "cli/app/app.h"
#include "cli/app/board_options.h"
#include "cli/app/image_size.h"
#include "cli/app/option_checks.h"
#include "cli/commands/camera_values.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct BoardArgs {
  Board board = no_board();
  std::string camera_file, model = "brown", size = "800x600";
  int photos = 20;
  double max_tilt_deg = 35.0, bow_mm = 0.0, shape_sigma_mm = 0.0, autofocus = 0.0;
  double blur_px = 0.6, noise = 2.0, sigma_px = 0.1, shared_px = 0.0;
  bool corners_only = false;
};

Camera camera_from(const BoardArgs& args, Run& run) {
  if (!args.camera_file.empty()) return read_camera_input(run, args.camera_file);
  const auto [width, height] = image_size(args.size);
  auto camera = example_camera(args.model, width, height);
  if (!camera) throw UsageError("--model: '" + args.model + "' is not pinhole, brown, kannala_brandt or flat_port");
  return *camera;
}

std::string corners_csv(const std::vector<BoardView>& views) {
  std::string csv = "photo,corner,u_px,v_px,sigma_u_px,sigma_v_px\n";
  for (const BoardView& view : views) {
    for (const Corner& corner : view.corners) {
      csv += fmt::format("{},{},{:.6f},{:.6f},{:.6g},{:.6g}\n", view.photo, corner.index, corner.px.x(), corner.px.y(),
                         std::sqrt(corner.cov(0, 0)), std::sqrt(corner.cov(1, 1)));
    }
  }
  return csv;
}

std::string true_corners_csv(const BoardScene& scene) {
  std::string csv = "photo,corner,u_px,v_px\n";
  for (std::size_t i = 0; i < scene.cam_from_board.size(); ++i) {
    const std::vector<Eigen::Vector2d> corners = true_corners(scene, i);
    for (std::size_t k = 0; k < corners.size(); ++k)
      csv += fmt::format("{},{},{:.6f},{:.6f}\n", photo_name(i), k, corners[k].x(), corners[k].y());
  }
  return csv;
}

std::string poses_csv(const BoardScene& scene) {
  std::string csv = "photo,x_m,y_m,z_m,qw,qx,qy,qz\n";
  for (std::size_t i = 0; i < scene.cam_from_board.size(); ++i) {
    const Rigid3& pose = scene.cam_from_board[i];
    csv +=
        fmt::format("{},{},{},{},{},{},{},{}\n", photo_name(i), pose.translation.x(), pose.translation.y(),
                    pose.translation.z(), pose.rotation.w(), pose.rotation.x(), pose.rotation.y(), pose.rotation.z());
  }
  return csv;
}

std::string board_csv(const BoardScene& scene) {
  std::string csv = "corner,x_m,y_m,z_m\n";
  for (std::size_t k = 0; k < scene.points_in_board.size(); ++k) {
    const Eigen::Vector3d& point = scene.points_in_board[k];
    csv += fmt::format("{},{},{},{}\n", k, point.x(), point.y(), point.z());
  }
  return csv;
}

void add_photos(const BoardScene& scene, const BoardArgs& args, Run& run) {
  RenderConfig config;
  config.blur_px = args.blur_px;
  config.noise = args.noise;
  for (std::size_t i = 0; i < scene.cam_from_board.size(); ++i) {
    report_progress(run.progress, "photos", i, scene.cam_from_board.size());
    run.add_file(photo_name(i), png_bytes(render_board_photo(scene, i, config, run.options.seed)));
  }
}

void describe_truth(const BoardScene& scene, Run& run) {
  run.document.estimate["camera"] = camera_values(scene.camera);
  run.document.counts.given = run.document.counts.used = scene.cam_from_board.size();
}

/// Photos of a board with their truth, or its corners only.
ExitCode simulate_board(const BoardArgs& args, Run& run) {
  Board board = args.board;
  require_board(board);
  const BoardSceneConfig config{.num_photos = args.photos,
                                .max_tilt_rad = args.max_tilt_deg * std::numbers::pi / 180.0,
                                .bow_m = 1e-3 * args.bow_mm,
                                .shape_sigma_m = 1e-3 * args.shape_sigma_mm,
                                .into_corners = true};
  BoardScene scene = draw_board_scene(camera_from(args, run), board, config, run.options.seed);
  scene.autofocus = args.autofocus;
  describe_truth(scene, run);
  std::vector<BoardView> views = simulate_views(scene, args.sigma_px, run.options.seed);
  if (args.shared_px > 0.0) add_shared_errors(scene, args.shared_px, run.options.seed + 1, views);
  run.add_file("corners.csv", corners_csv(views));
  run.add_file("truth_corners.csv", true_corners_csv(scene));
  run.add_file("truth_camera.yaml", camera_text(scene.camera, CameraFormat::alidade));
  run.add_file("truth_poses.csv", poses_csv(scene));
  run.add_file("truth_board.csv", board_csv(scene));
  if (!args.corners_only) add_photos(scene, args, run);
  run.lap("simulate");
  const std::string what = fmt::format("{} {} of a {}×{} {}", args.photos, args.corners_only ? "views" : "photos",
                                       board.cols, board.rows, std::string(kind_name(board.kind)));
  run.say(fmt::format("{} and their truth in {}", what, run.options.out.string()));
  Verdict verdict;
  verdict.sentence = what + " with known truth";
  return run.finish(verdict);
}

void add_board_scenario(App& app) {
  auto args = std::make_shared<BoardArgs>();
  CLI::App& command = app.add_command(
      {"simulate board", "Photos of a calibration board and its corners, with the true camera, poses and board",
       "  alidade simulate board --board 9x6 --square 0.025 --photos 20 --out photos\n"
       "  alidade simulate board --board 9x6 --square 0.025 --corners-only --sigma-px 0.05",
       true},
      [args](Run& run) { return simulate_board(*args, run); });
  add_board_options(command, args->board);
  command.add_option("--photos", args->photos, "Number of photos")->check(CLI::Range(1, 100000))->capture_default_str();
  command.add_option("--camera", args->camera_file, "True camera (default: an example camera)")->type_name("FILE");
  command.add_option("--model", args->model, "Lens model of the example camera")
      ->type_name("NAME")
      ->capture_default_str();
  command.add_option("--size", args->size, "Image size of the example camera")->type_name("WxH")->capture_default_str();
  add_number(command, "--max-tilt-deg", args->max_tilt_deg, "Largest tilt of the board [deg]", 0.0, 80.0);
  add_number(command, "--bow-mm", args->bow_mm, "Height of the board's centre above its corners [mm]", -1000.0, 1000.0);
  add_number(command, "--shape-sigma-mm", args->shape_sigma_mm,
             "σ of the board points about their nominal positions [mm]", 0.0, 1000.0);
  add_number(command, "--autofocus", args->autofocus,
             "Autofocus left on: relative increase of the focal length with the board at 0.5 m, over that far away "
             "(the one in truth_camera.yaml)",
             -0.2, 0.2);
  add_number(command, "--blur", args->blur_px, "σ of the optical blur [px]", 0.0, 20.0);
  add_number(command, "--noise", args->noise, "σ of the grey-level noise, of 255", 0.0, 100.0);
  add_number(command, "--sigma-px", args->sigma_px, "σ of the corners in corners.csv [px]", 0.0, 100.0);
  add_number(command, "--shared-px", args->shared_px,
             "Errors in corners.csv shared by the corners of a photo: σ of each term of a smooth field [px]", 0.0,
             100.0);
  command.add_flag("--corners-only", args->corners_only, "Write no photos");
}

}  // namespace

void add_simulate(App& app) {
  app.add_group("simulate", "Simulate measurements with ground truth, in the files that the other commands read");
  constexpr std::array scenarios{add_board_scenario,     add_fleet_scenario,
                                 add_head_scenario,      add_rangefinder_scenario,
                                 add_rig_scenario,       add_rotation_scenario,
                                 add_servo_scenario,     add_track_scenario,
                                 add_underwater_scenario};  // one function a scenario
  for (const auto add_scenario : scenarios) add_scenario(app);
}

}  // namespace alidade::cli
