#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <opencv2/core.hpp>

#include "alidade/formats/beam_file.h"
#include "alidade/formats/camera_file.h"
#include "alidade/imaging/image_codecs.h"
#include "alidade/simulate/films/spot_photos.h"
#include "alidade/simulate/rangefinder.h"
#include "alidade/tables/corner_file.h"
#include "alidade/tables/shots_file.h"
#include "cli/app/app.h"
#include "cli/app/option_checks.h"
#include "cli/commands/camera_values.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct SimulateRangefinderArgs {
  std::string scenario = "reference", laser = "red";
  std::filesystem::path camera;
  std::optional<int> shots;
  double sigma_range_m = 0.002, scale = 1.0;
  ShotNoise noise;
  ShotMistake mistake;
  std::string unit = "m";
  int stickers = 0, jpeg = 0;
  double speckle = 0.0;
  bool photos = false, photos_off = false, bayer = false;
};

std::string row_name(std::size_t i) { return fmt::format("shot_{:03}.png", i + 1); }

RangefinderScene scene_of(const SimulateRangefinderArgs& args, Run& run) {
  auto config = rangefinder_scenario(args.scenario);
  if (!config)
    throw UsageError(
        fmt::format("--scenario: '{}' is not one of {}", args.scenario, fmt::join(rangefinder_scenarios(), ", ")));
  if (!args.camera.empty()) {
    config->camera = read_central_camera(args.camera);
    add_camera_input(run, args.camera);
  }
  config->num_shots = args.shots.value_or(config->num_shots);
  config->beam.noise = {args.sigma_range_m, 0.0, 0.0};
  config->beam.scale = args.scale;
  return draw_rangefinder_scene(*config, run.options.seed);
}

/// Photos of the boards with the spot, and shots that name them: what a user brings home.
void add_photos(const SimulateRangefinderArgs& args, const RangefinderScene& scene, std::vector<Shot>& shots,
                Run& run) {
  SpotScene spots;
  spots.boards = {scene.camera, scene.board, points_in_board(scene.board), scene.cam_from_board};
  spots.beam_origin_in_cam = scene.beam.origin_in_cam;
  spots.beam_direction_in_cam = scene.beam.direction_in_cam;
  for (const double range_m : scene.range_m) spots.range_m.push_back(scene.beam.scale * range_m);
  SpotPhotoConfig config;
  config.speckle = args.speckle;
  config.is_bayer = args.bayer;
  config.jpeg_quality = args.jpeg;
  config.num_stickers = args.stickers;
  config.laser.colour = args.laser == "green" ? LaserColour::green : LaserColour::red;
  const auto add = [&](std::size_t i, bool is_on, const std::string& name) {
    config.is_on = is_on;
    run.add_file(name, png_bytes(render_spot_photo(spots, i, config, run.options.seed + (is_on ? 0u : 1u))));
  };
  for (std::size_t i = 0; i < shots.size(); ++i) {
    report_progress(run.progress, "photos", i, shots.size());
    shots[i].spot.reset();
    add(i, true, row_name(i));
    if (args.photos_off) add(i, false, "off_" + row_name(i));
  }
}

std::string table_of(const SimulateRangefinderArgs& args, const std::vector<Shot>& shots) {
  if (!args.photos) return shots_csv(shots, true);
  std::string text = args.photos_off ? "range_m,photo,photo_off\n" : "range_m,photo\n";
  for (std::size_t i = 0; i < shots.size(); ++i) {
    text += fmt::format("{:.9g},{}", shots[i].range_m, row_name(i));
    text += args.photos_off ? ",off_" + row_name(i) + "\n" : "\n";
  }
  return text;
}

ShotMistake mistake_of(const SimulateRangefinderArgs& args) {
  ShotMistake mistake = args.mistake;
  for (const auto& [name, metres] :
       {std::pair{"mm", 0.001}, std::pair{"cm", 0.01}, std::pair{"inch", 0.0254}, std::pair{"feet", 0.3048}})
    if (args.unit == name) mistake.unit_m = metres;
  return mistake;
}

ExitCode simulate_rangefinder(const SimulateRangefinderArgs& args, Run& run) {
  const RangefinderScene scene = scene_of(args, run);
  SimulatedShots simulated = simulate_shots(scene, args.noise, run.options.seed);
  simulated.shots = mistaken_shots(std::move(simulated.shots), mistake_of(args));
  std::vector<BoardView> views;
  for (std::size_t i = 0; i < simulated.shots.size(); ++i) {
    Shot& shot = simulated.shots[i];
    shot.name = row_name(i);
    if (!shot.board) continue;
    shot.board->photo = shot.name;
    views.push_back(*shot.board);
  }
  if (args.photos) add_photos(args, scene, simulated.shots, run);
  run.add_file("shots.csv", table_of(args, simulated.shots));
  if (!args.photos) run.add_file("corners.csv", corners_csv(views));
  const Camera given = mistaken_camera(scene.camera, args.mistake);
  run.add_file("camera.yaml", camera_text(given, CameraFormat::alidade));
  run.add_file("truth_rangefinder.yaml", beam_text(scene.beam, scene.camera, "camera.yaml"));
  JsonValue outliers = JsonValue::list();
  for (std::size_t i = 0; i < simulated.is_outlier.size(); ++i)
    if (simulated.is_outlier[i]) outliers.push_back(row_name(i));
  run.document.estimate["outliers"] = std::move(outliers);
  run.document.counts.given = run.document.counts.used = simulated.shots.size();
  Verdict verdict;
  verdict.sentence = fmt::format("{} shots of a rangefinder with known truth; board {}x{}, {:g} m",
                                 simulated.shots.size(), scene.board.cols, scene.board.rows, scene.board.square_m);
  run.say(fmt::format("{} in {}", verdict.sentence, run.options.out.string()));
  return run.finish(verdict);
}

/// What of the readings and the camera file is not right.
void add_mistakes(CLI::App& command, SimulateRangefinderArgs& args) {
  add_number(command, "--offset-m", args.mistake.offset_m, "Constant error of the readings [m]", -1.0, 1.0);
  add_number(command, "--focal-error", args.mistake.focal, "Relative error of the focal length in the camera file",
             -0.5, 0.5);
  add_number(command, "--centre-error", args.mistake.centre_px, "Error of cx and cy in the camera file [px]", -1e3,
             1e3);
  add_number(command, "--k1-error", args.mistake.k1, "Error of k1 in the camera file", -1.0, 1.0);
  add_number(command, "--p1-error", args.mistake.p1, "Error of p1 in the camera file", -0.1, 0.1);
  add_number(command, "--drift-m", args.mistake.drift_m, "Drift of the readings from the first shot to the last [m]",
             -1.0, 1.0);
  add_number(command, "--bend-m", args.mistake.bend_m,
             "Quadratic error of the readings: this size at 1 m and 3 m, zero at 2 m [m]", -1.0, 1.0);
  add_number(command, "--wander-px", args.mistake.wander_px, "Drift of the spots from the first shot to the last [px]",
             -1e3, 1e3);
  add_number(command, "--bow-m", args.noise.bow_m,
             "Bow of the board along its rows: height of its centre above its left and right edges [m]", -0.1, 0.1);
  add_number(command, "--twist-m", args.noise.twist_m, "Twist of the board: height of its corners above its plane [m]",
             -0.1, 0.1);
  add_number(command, "--incidence-m", args.noise.incidence_m,
             "Error of a reading at 45° incidence, proportional to the tangent of the angle [m]", -1.0, 1.0);
  add_number(command, "--sheet-m", args.noise.sheet_m,
             "Distance of the surface hit by the beam in front of the plane of the corners [m]", -0.1, 0.1);
  command.add_flag("--exchange-uv", args.mistake.exchange_uv, "Swap u and v of the spots");
  command.add_option("--unit", args.unit, "Unit of the readings in the table")
      ->check(CLI::IsMember({"m", "mm", "cm", "inch", "feet"}))
      ->capture_default_str();
  command.add_option("--shift-rows", args.mistake.shift_rows, "Delay of the ranges, in rows of the table")
      ->check(CLI::Range(-100, 100))
      ->capture_default_str();
}

/// Photos instead of spots and corners, and how they look.
void add_photo_options(CLI::App& command, SimulateRangefinderArgs& args) {
  add_number(command, "--speckle", args.speckle, "With --photos: contrast of the laser speckle; 1: full", 0.0, 1.0);
  command.add_flag("--bayer", args.bayer,
                   "With --photos: Bayer pattern, one colour per pixel, the others interpolated");
  command.add_option("--jpeg", args.jpeg, "With --photos: JPEG quality; 0: uncompressed")
      ->check(CLI::Range(0, 100))
      ->capture_default_str();
  command
      .add_option("--stickers", args.stickers,
                  "With --photos: number of red spots on the board that are not the laser's")
      ->check(CLI::Range(0, 10))
      ->capture_default_str();
  command.add_flag("--photos", args.photos, "Render photos instead of spots and corners");
  command.add_flag("--photos-off", args.photos_off, "With --photos: also render each photo with the laser off");
  command.add_option("--laser", args.laser, "Colour of the laser in photos: red or green")
      ->check(CLI::IsMember({"red", "green"}))
      ->capture_default_str();
}

}  // namespace

void add_rangefinder_scenario(App& app) {
  auto args = std::make_shared<SimulateRangefinderArgs>();
  CLI::App& command = app.add_command(
      {"simulate rangefinder", "Shots of a laser rangefinder beside a camera, with boards, spots and ground truth",
       "  alidade simulate rangefinder --out shots && alidade rangefinder shots/shots.csv --camera shots/camera.yaml "
       "\\\n"
       "    --corners shots/corners.csv --board 9x6 --square 0.04\n"
       "  alidade simulate rangefinder --photos --shots 12 --out photos",
       true},
      [args](Run& run) { return simulate_rangefinder(*args, run); });
  command.add_option("--scenario", args->scenario, fmt::format("{}", fmt::join(rangefinder_scenarios(), ", ")))
      ->capture_default_str();
  command.add_option("--shots", args->shots, "Number of shots (default: the scenario's)")->check(CLI::Range(1, 10000));
  command.add_option("--camera", args->camera, "True camera (default: an example camera)")->type_name("FILE");
  add_number(command, "--sigma-range-m", args->sigma_range_m, "σ of a reading [m]", 0.0, 1.0);
  add_number(command, "--sigma-px", args->noise.sigma_spot_px, "σ of a spot's coordinate [px]", 0.0, 100.0);
  add_number(command, "--sigma-corner-px", args->noise.sigma_corner_px, "σ of a corner's coordinate [px]", 0.0, 100.0);
  add_number(command, "--outliers", args->noise.outlier_share, "Share of shots whose beam misses the board", 0.0, 0.9);
  add_number(command, "--scale", args->scale, "True range / range read", 0.5, 2.0);
  add_number(command, "--sigma-px-near", args->noise.sigma_spot_near_px,
             "Additional σ of a spot at 1 m, falling with range [px]", 0.0, 100.0);
  add_mistakes(command, *args);
  add_photo_options(command, *args);
}

}  // namespace alidade::cli
