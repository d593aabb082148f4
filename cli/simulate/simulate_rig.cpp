#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <opencv2/core.hpp>

#include "alidade/formats/camera_file.h"
#include "alidade/formats/rig_file.h"
#include "alidade/geometry/degree.h"
#include "alidade/imaging/image_codecs.h"
#include "alidade/simulate/boards/board_photos.h"
#include "alidade/simulate/rangefinder.h"
#include "alidade/simulate/rig.h"
#include "alidade/tables/views_file.h"
#include "cli/app/app.h"
#include "cli/app/option_checks.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct SimulateRigArgs {
  std::string scenario = "reference";
  std::filesystem::path rig;
  int boards = 8, views = 4;
  double sigma_px = 0.2, sigma_angle_deg = 0.02, wrong = 0.0;
  double scale = 1.0, once_deg = 0.0, twice_deg = 0.0, backlash_deg = 0.0, moved_mm = 0.0;
  double wrong_corners = 0.0, stretch = 0.0, bend_mm = 0.0;
  RigMistake mistake;
  bool photos = false;
};

RigSceneConfig config_from(const SimulateRigArgs& args, Run& run) {
  RigSceneConfig config;
  config.num_boards = args.boards;
  config.max_views_of_a_board = args.views;
  config.encoder_scale = args.scale;
  config.once_rad = args.once_deg * degree;
  config.sigma_moved_m = 1e-3 * args.moved_mm;
  config.print_stretch = args.stretch;
  config.board_bend_m = 1e-3 * args.bend_mm;
  for (RigHead& head : xiahou_rig()) config.nominal.push_back(head);
  if (!args.rig.empty()) {
    run.add_input("rig", args.rig);
    config.nominal = read_rig(args.rig).heads;
  }
  if (args.scenario == "pan_only") config.tilts_rad = {5.0 * degree};
  if (args.scenario == "tilt_only") config.pans_rad = {0.0};
  if (args.scenario == "unlinked") config.shared = false;
  if (args.scenario == "one_head") config.nominal.resize(1);
  return config;
}

std::string photo_of(std::size_t v) { return fmt::format("view_{:03}.png", v); }

/// Photos of the boards instead of corners.
void add_photos(const RigScene& scene, const std::vector<HeadView>& views, Run& run) {
  std::string table = "view,board,head,pan_rad,tilt_rad,photo\n";
  for (std::size_t v = 0; v < views.size(); ++v) {
    report_progress(run.progress, "photos", v, views.size());
    const HeadView& truth = scene.views[v];
    for (const RigHead& rig_head : scene.rig.heads) {
      if (rig_head.head.id != truth.head) continue;
      const Rigid3& world_from_board = scene.world_from_board[static_cast<std::size_t>(truth.board)];
      const BoardScene shown{.camera = rig_head.camera,
                             .board = scene.board,
                             .points_in_board = points_in_board(scene.board),
                             .cam_from_board = {cam_from_world(rig_head.head, truth.pan_tilt_rad) * world_from_board}};
      run.add_file(photo_of(v), png_bytes(render_board_photo(shown, 0, {}, run.options.seed + v)));
    }
    table += fmt::format("{},{},{},{},{},{}\n", v, truth.board, truth.head, views[v].pan_tilt_rad.x(),
                         views[v].pan_tilt_rad.y(), photo_of(v));
  }
  run.add_file("views.csv", table);
}

/// The lens is the true one; its file says so: focal lengths and centre to a thousandth of a pixel.
Camera with_sigma(Camera camera) {
  constexpr double sigma_px = 1e-3;
  if (camera.cov.size() > 0) return camera;
  const auto num = static_cast<Eigen::Index>(params(camera.lens).size());
  camera.cov.setZero(num, num);
  camera.cov.diagonal().head<4>().setConstant(sigma_px * sigma_px);
  return camera;
}

ExitCode simulate_rig(const SimulateRigArgs& args, Run& run) {
  const RigScene scene = draw_rig_scene(config_from(args, run), run.options.seed);
  const RigNoise noise{args.sigma_px,           args.sigma_angle_deg * degree, args.wrong,
                       args.twice_deg * degree, args.backlash_deg * degree,    args.wrong_corners};
  SimulatedViews simulated = simulate_head_views(scene, noise, run.options.seed);
  simulated.views = mistaken_views(std::move(simulated.views), scene, args.mistake);
  if (args.photos) {
    add_photos(scene, simulated.views, run);
  } else {
    run.add_file("views.csv", views_csv(simulated.views));
  }
  std::vector<std::string> camera_files;
  for (const RigHead& rig_head : scene.rig.heads) {
    camera_files.push_back(fmt::format("camera_{}.yaml", rig_head.head.id));
    const Camera given =
        mistaken_camera(rig_head.camera, {.focal = args.mistake.focal, .centre_px = args.mistake.centre_px});
    run.add_file(camera_files.back(), camera_text(with_sigma(given), CameraFormat::alidade));
  }
  // Where the files of the lenses are wrong, the truth has its own.
  const bool is_mistaken = args.mistake.focal != 0.0 || args.mistake.centre_px != 0.0;
  run.add_file("truth_rig.yaml", rig_text(scene.rig, is_mistaken ? std::vector<std::string>{} : camera_files));
  JsonValue wrong = JsonValue::list();
  for (std::size_t v = 0; v < simulated.is_wrong.size(); ++v)
    if (simulated.is_wrong[v]) wrong.push_back(simulated.views[v].seen.photo);
  run.document.estimate["wrong_views"] = std::move(wrong);
  run.document.counts.given = run.document.counts.used = simulated.views.size();
  Verdict verdict;
  verdict.sentence =
      fmt::format("{} views of {} boards by {} heads with known truth; board {}x{}, {:g} m", simulated.views.size(),
                  args.boards, scene.rig.heads.size(), scene.board.cols, scene.board.rows, scene.board.square_m);
  run.say(fmt::format("{} in {}", verdict.sentence, run.options.out.string()));
  return run.finish(verdict);
}

}  // namespace

void add_rig_scenario(App& app) {
  auto args = std::make_shared<SimulateRigArgs>();
  CLI::App& command = app.add_command(
      {"simulate rig", "Views of boards by two pan-tilt heads, with encoder angles and ground truth",
       "  alidade simulate rig --out views && alidade rig views/views.csv --camera views/camera_1.yaml \\\n"
       "    --camera views/camera_2.yaml --board 9x6 --square 0.025 --sigma-square 1e-6 --sigma-scale 1e-6\n"
       "  alidade simulate rig --photos --out photos",
       true},
      [args](Run& run) { return simulate_rig(*args, run); });
  command.add_option("--scenario", args->scenario, "reference, pan_only, tilt_only, unlinked, one_head")
      ->check(CLI::IsMember({"reference", "pan_only", "tilt_only", "unlinked", "one_head"}))
      ->capture_default_str();
  command
      .add_option("--rig", args->rig, "Nominal rig that the random one is close to (default: the paper's two heads)")
      ->type_name("FILE");
  command.add_option("--boards", args->boards, "Number of board positions")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command.add_option("--views", args->views, "Maximum views of each board position by each head")
      ->check(CLI::Range(2, 1000))
      ->capture_default_str();
  add_number(command, "--sigma-px", args->sigma_px, "σ of a corner's coordinate [px]", 0.0, 100.0);
  add_number(command, "--sigma-angle-deg", args->sigma_angle_deg, "σ of an encoder reading [deg]", 0.0, 10.0);
  add_number(command, "--wrong", args->wrong, "Share of the views that have the angles of another view", 0.0, 0.5);
  add_number(command, "--scale", args->scale, "True angle / angle read, of each axis", 0.5, 2.0);
  add_number(command, "--once-deg", args->once_deg,
             "Amplitude of an encoder error with one period per revolution, each axis [deg]", 0.0, 15.0);
  add_number(command, "--twice-deg", args->twice_deg, "Likewise with two periods per revolution [deg]", 0.0, 15.0);
  add_number(command, "--backlash-deg", args->backlash_deg, "Backlash of each axis [deg]", 0.0, 10.0);
  add_number(command, "--moved-mm", args->moved_mm,
             "σ of each coordinate of the board's movement between the heads' views [mm]", 0.0, 100.0);
  add_number(command, "--wrong-corners", args->wrong_corners, "Share of the corners displaced by up to 30 px", 0.0,
             0.5);
  add_number(command, "--stretch", args->stretch,
             "Relative stretch of the printed column spacing against the row spacing", -0.1, 0.1);
  add_number(command, "--bend-mm", args->bend_mm, "Bend of the board: height of its ends above its centre [mm]", -20.0,
             20.0);
  add_number(command, "--focal-error", args->mistake.focal, "Relative error of the focal lengths in the camera files",
             -0.5, 0.5);
  add_number(command, "--centre-error", args->mistake.centre_px, "Error of cx and cy in the camera files [px]", -1e3,
             1e3);
  command.add_flag("--swap-angles", args->mistake.swap_angles, "Swap pan and tilt");
  command.add_flag("--flip-pan", args->mistake.flip_pan, "Reverse the sign of pan");
  command.add_flag("--mirror", args->mistake.mirror, "Mirror the images");
  command.add_flag("--swap-heads", args->mistake.swap_heads, "Swap the numbers of the heads");
  command.add_flag("--shift-rows", args->mistake.shift_rows, "Give each view the angles of the previous one");
  add_number(command, "--pan-read", args->mistake.pan_read,
             "Pan column / true pan angle of the second head (0.5: half)", 0.1, 10.0);
  command.add_flag("--turn-corners", args->mistake.turn_corners,
                   "Number the second head's corners from the other end of the board");
  command.add_flag("--photos", args->photos, "Render photos instead of corners");
}

}  // namespace alidade::cli
