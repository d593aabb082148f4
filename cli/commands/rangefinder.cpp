#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <mutex>
#include <opencv2/core.hpp>
#include <set>

#include "alidade/formats/beam_file.h"
#include "alidade/formats/camera_file.h"
#include "alidade/formats/camera_json.h"
#include "alidade/images/photos.h"
#include "alidade/rangefinder/shot_photos.h"
#include "alidade/results/rangefinder_document.h"
#include "alidade/tables/corner_file.h"
#include "alidade/tables/shots_file.h"
#include "cli/app/app.h"
#include "cli/app/board_options.h"
#include "cli/app/option_checks.h"
#include "cli/commands/commands.h"
#include "cli/commands/rangefinder_edges.h"

namespace alidade::cli {
namespace {

constexpr std::size_t max_images = 40;  // of the page

struct RangefinderArgs {
  std::filesystem::path shots, camera, corners, photo, start;
  std::string method = "joint", refine = "all", spot = "auto", outliers = "drop";
  Board board = no_board();
  double sigma_px = 0.0, sigma_range_m = 0.0, sigma_range_per_m = 0.0, sigma_incidence_m = 0.0;
  std::optional<double> sigma_square_m, sigma_scale;
  bool scale = false, skip_bad = false;
};

RangefinderConfig config_from(const RangefinderArgs& args, std::uint64_t seed) {
  RangefinderConfig config;
  config.method = args.method == "spot"    ? RangefinderMethod::spot
                  : args.method == "plane" ? RangefinderMethod::plane
                                           : RangefinderMethod::joint;
  config.refine = args.refine == "all" ? Refine::all : Refine::beam;
  config.estimate_scale = args.scale;
  config.reject_outliers = args.outliers == "drop";
  config.seed = seed;
  if (args.sigma_px > 0.0) config.sigma_spot_px = args.sigma_px;
  if (args.scale && args.sigma_scale) throw UsageError("--scale estimates what --sigma-scale tells; give one of them");
  if (args.sigma_square_m && !is_given(args.board)) throw UsageError("--sigma-square needs --board and --square");
  config.sigma_square_m = args.sigma_square_m;
  config.sigma_scale = args.sigma_scale;
  if (args.sigma_range_m > 0.0)
    config.range_noise = RangeNoise{args.sigma_range_m, args.sigma_range_per_m, args.sigma_incidence_m};
  else if (args.sigma_range_per_m > 0.0 || args.sigma_incidence_m > 0.0)
    throw UsageError("--sigma-range-per-m and --sigma-incidence-m add to --sigma-range-m; give that too");
  return config;
}

SpotColour colour_of(const std::string& word) {
  return word == "red"      ? SpotColour::red
         : word == "green"  ? SpotColour::green
         : word == "bright" ? SpotColour::bright
                            : SpotColour::automatic;
}

/// The rows' photos; a path is relative to the table's.
class ShotShelf {
 public:
  ShotShelf(const std::vector<ShotRow>& rows, std::filesystem::path folder, Run& run)
      : rows_(rows), folder_(std::move(folder)), run_(run) {}

  cv::Mat load(std::size_t i, bool laser_off) {
    const std::string& name = laser_off ? rows_[i].photo_off : rows_[i].photo;
    if (name.empty()) return {};
    const std::filesystem::path file = folder_ / name;
    const std::string bytes = read_file(file);
    {
      const std::scoped_lock lock(mutex_);
      if (noted_.insert(file.string()).second) run_.add_input(laser_off ? "photo_off" : "photo", file.string(), bytes);
    }
    return decode_photo(bytes);
  }

 private:
  const std::vector<ShotRow>& rows_;
  std::filesystem::path folder_;
  Run& run_;
  std::mutex mutex_;
  std::set<std::string> noted_;  ///< Photos that are among the inputs already.
};

/// Views of a corners file go to the shots whose photo they name.
void add_corners(const RangefinderArgs& args, const Board& board, const std::vector<ShotRow>& rows,
                 std::vector<Shot>& shots, Run& run) {
  run.add_input("corners", args.corners);
  const std::vector<BoardView> views = read_corners(args.corners, num_points(board));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    for (const BoardView& view : views)
      if (!rows[i].photo.empty() && view.photo == rows[i].photo) shots[i].board = view;
    if (rows[i].photo.empty() || shots[i].board) continue;
    run.say(fmt::format("no board: {}: has no corners in {}", rows[i].photo, args.corners.string()));
  }
}

/// Simulated and measured elsewhere: shots name photos that nobody has, and their corners lie beside them.
std::string corners_beside(const std::filesystem::path& shots) {
  const std::filesystem::path corners = shots.parent_path() / "corners.csv";
  return std::filesystem::exists(corners)
             ? fmt::format("; for the corners in its stead: --corners {}", corners.string())
             : "";
}

/// Enough boards tell the beam by themselves: a light that is elsewhere is no spot.
void look_where_boards_say(std::vector<Shot>& shots, std::vector<ShotPhoto>& seen, const ShotPhotoLoader& load,
                           const Camera& camera, const ShotPhotosConfig& photos, RangefinderConfig config, Run& run) {
  config.method = RangefinderMethod::plane;
  const std::vector<Eigen::Vector3d> points = points_in_board(*photos.board);
  RangefinderReport report = calibrate_rangefinder(shots, points, camera, config, run.progress);
  if (wants_scale(report, config)) {
    config.estimate_scale = true;
    report = calibrate_rangefinder(shots, points, camera, config, run.progress);
  }
  if (report.status != RangefinderReport::Status::converged) return;
  look_again_for_spots(shots, seen, load, report.camera, report.beam, photos, run.progress);
}

/// Boards and spots out of the photos. What is wrong with a photo stops the run, or with --skip-bad its row is named.
void add_photos(const RangefinderArgs& args, const std::optional<Board>& board, const Camera& camera, ShotsFile& file,
                const RangefinderConfig& rangefinder, std::vector<Shot>& shots, Run& run) {
  ShotShelf shelf(file.rows, args.shots.parent_path(), run);
  ShotPhotosConfig config{.board = board, .find_spots = args.method != "plane"};
  config.spot.colour = colour_of(args.spot);
  const ShotPhotoLoader load = [&shelf](std::size_t i, bool laser_off) { return shelf.load(i, laser_off); };
  std::vector<ShotPhoto> seen = look_at_photos(shots, load, camera, config, run.progress);
  if (board && config.find_spots && args.method == "joint")
    look_where_boards_say(shots, seen, load, camera, config, rangefinder, run);
  std::vector<ShotRow> kept_rows;
  std::vector<Shot> kept;
  for (std::size_t i = 0; i < shots.size(); ++i) {
    const std::string where =
        fmt::format("{}:{}: photo '{}': ", args.shots.string(), file.rows[i].line, file.rows[i].photo);
    if (!seen[i].fault.empty()) {
      if (!args.skip_bad) throw InputError(where + seen[i].fault + corners_beside(args.shots));
      file.skipped.push_back({args.shots.string(), file.rows[i].line, seen[i].fault});
      continue;
    }
    if (!seen[i].no_board.empty()) run.say(fmt::format("no board: {}: {}", file.rows[i].photo, seen[i].no_board));
    if (!seen[i].false_spot.empty()) run.say(fmt::format("no spot: {}: {}", file.rows[i].photo, seen[i].false_spot));
    if (!seen[i].no_spot.empty() && seen[i].false_spot.empty())
      run.say(fmt::format("no spot: {}: {}", file.rows[i].photo, seen[i].no_spot));
    kept_rows.push_back(file.rows[i]);
    kept.push_back(shots[i]);
    if (seen[i].has_photo && !run.options.no_report && kept.size() <= max_images)
      run.add_image(shots[i].name, jpeg_preview(shelf.load(i, false), 640, 75));
  }
  file.rows = std::move(kept_rows);
  shots = std::move(kept);
  run.lap("look_at_photos");
}

void summarize(const RangefinderReport& report, std::span<const Shot> shots, const RangefinderConfig& config,
               Run& run) {
  for (std::size_t i = 0; i < shots.size(); ++i) {
    if (!report.shots[i].used && !report.shots[i].reason.empty())
      run.say(fmt::format("not used: {}: {}", shots[i].name, report.shots[i].reason));
  }
  if (report.status != RangefinderReport::Status::converged) return;
  const Beam& beam = report.beam;
  const Eigen::Matrix<double, 7, 7> cov = embedded_covariance(beam);
  const std::array<const char*, 3> axes{"x", "y", "z"};
  for (int i = 0; i < 3; ++i)
    run.say(fmt::format("origin {}    {:9.2f} ± {:.2g} mm   (3σ)", axes[static_cast<std::size_t>(i)],
                        1e3 * beam.origin_in_cam[i], 3e3 * std::sqrt(cov(i, i))));
  for (int i = 0; i < 3; ++i)
    run.say(fmt::format("direction {} {:9.6f} ± {:.2g}", axes[static_cast<std::size_t>(i)], beam.direction_in_cam[i],
                        3.0 * std::sqrt(cov(3 + i, 3 + i))));
  if (report.beam.cov(5, 5) > 0.0 && config.scale_by_need)
    run.say("the readings' scale is estimated, as nobody told it (--sigma-scale)");
  if (cov(6, 6) > 0.0) run.say(fmt::format("scale       {:9.6f} ± {:.2g}", beam.scale, 3.0 * std::sqrt(cov(6, 6))));
  run.say(fmt::format("{} of {} shots; σ of a range {:.2g} mm ({})", report.shots_used, shots.size(),
                      1e3 * beam.noise.sigma_m, report.range_sigma_is_told ? "told by the residuals" : "as given"));
  run.say(fmt::format("where the spot is, 3σ: {:.2g} px at 0.5 m, {:.2g} at 1 m, {:.2g} at 2 m, {:.2g} at 4 m",
                      3.0 * report.bound.spot_sigma_px[0], 3.0 * report.bound.spot_sigma_px[1],
                      3.0 * report.bound.spot_sigma_px[2], 3.0 * report.bound.spot_sigma_px[3]));
}

/// What the report shows beside the answer: what more shots bring, and how well each shot is foretold by the others.
RangefinderExtras extras_of(const RangefinderReport& report, std::span<const Shot> shots,
                            std::span<const Eigen::Vector3d> points, const Camera& camera,
                            const RangefinderConfig& config, const std::optional<Board>& board, Run& run) {
  RangefinderExtras extras{.board = board, .gains = {}, .by_count = {}, .left_out = {}};
  if (report.status != RangefinderReport::Status::converged) return extras;
  extras.by_count = sigma_by_count(shots, report, points, camera, config, run.progress);
  extras.left_out = leave_one_out(shots, report, points, camera, config, run.progress);
  BeamNow now{.beam = report.beam, .camera = report.camera, .points_in_board = {points.begin(), points.end()}};
  now.method = config.method;
  now.estimate_scale = config.estimate_scale;
  if (report.sigma_spot_px > 0.0) now.sigma_spot_px = report.sigma_spot_px;
  if (report.sigma_corner_px > 0.0) now.sigma_corner_px = report.sigma_corner_px;
  if (now.points_in_board.empty()) now.points_in_board = points_in_board({.cols = 9, .rows = 6, .square_m = 0.04});
  if (!run.options.no_report) extras.gains = next_shot_gains(now, {});
  run.lap("checks");
  return extras;
}

ExitCode rangefinder(const RangefinderArgs& args, Run& run) {
  if (args.method == "edges") return align_scan({args.shots, args.camera, args.photo, args.start}, run);
  if (!args.photo.empty() || !args.start.empty()) throw UsageError("--photo and --start are for --method edges");
  std::optional<Board> board;
  if (is_given(args.board)) {
    board = args.board;
    require_board(*board);
  }
  const RangefinderConfig asked = config_from(args, run.options.seed);
  if (!args.corners.empty() && !board) throw UsageError("--corners needs --board and --square");
  run.add_input("shots", args.shots);
  run.add_input("camera", args.camera);
  ShotsFile file = read_shots(args.shots, {.skip_bad = args.skip_bad});
  const Camera camera = read_central_camera(args.camera);
  std::vector<Shot> shots;
  for (const ShotRow& row : file.rows) shots.push_back(row.shot);
  run.lap("read");
  if (!args.corners.empty()) {
    add_corners(args, *board, file.rows, shots, run);
  } else {
    add_photos(args, board, camera, file, asked, shots, run);
  }
  run.document.counts.given = file.skipped.size();
  run.document.counts.skipped = file.skipped;
  const std::vector<Eigen::Vector3d> points = board ? points_in_board(*board) : std::vector<Eigen::Vector3d>{};
  auto [report, verdict, config] = solve_rangefinder(shots, points, camera, asked, run.progress);
  run.lap("solve");
  summarize(report, shots, config, run);
  run.document.estimate["camera"] = camera_values(report.camera);  // that the beam belongs to
  fill_rangefinder(shots, report, config, extras_of(report, shots, points, camera, config, board, run), run.document);
  if (has_estimate(verdict)) {
    heed_assumptions(run.document.assumed, verdict);
    Camera seen = report.camera;
    if (config.refine == Refine::all)
      seen.source = "alidade rangefinder, refined from " + args.camera.filename().string();
    run.add_file("rangefinder.yaml", beam_text(report.beam, seen, "camera.yaml"));
    run.add_file("camera.yaml", camera_text(seen, CameraFormat::alidade));
  }
  return run.finish(verdict);
}

void add_options(CLI::App& command, RangefinderArgs& args) {
  command
      .add_option("shots", args.shots,
                  "Table of shots, CSV: range_m with any of u,v (spot), photo[,photo_off], nx,ny,nz,d (plane)")
      ->required();
  command.add_option("--camera", args.camera, "The camera that saw them")->type_name("FILE")->required();
  command
      .add_option("--method", args.method,
                  "joint: whatever each shot has; spot: no board is needed; plane: the spot need not be seen; edges: "
                  "direction alone, from a scan of the head (CSV pan,tilt,range_m) and --photo")
      ->check(CLI::IsMember({"joint", "spot", "plane", "edges"}))
      ->capture_default_str();
  command
      .add_option("--refine", args.refine,
                  "all: lens (as its covariance allows), boards and beam together; beam: lens and boards held")
      ->check(CLI::IsMember({"all", "beam"}))
      ->capture_default_str();
  add_board_options(command, args.board, /*is_required=*/false);
  command.add_option("--corners", args.corners, "Corners instead of photos: CSV photo,corner,u_px,v_px,…")
      ->type_name("FILE");
  command.add_option("--photo", args.photo, "With --method edges: the photo, taken with the head at zero")
      ->type_name("PHOTO");
  command
      .add_option("--start", args.start, "With --method edges: a rangefinder.yaml near it (default: along the view)")
      ->type_name("FILE");
  command.add_option("--spot", args.spot, "Colour of the laser: auto, red, green, or bright (in grey photos)")
      ->check(CLI::IsMember({"auto", "red", "green", "bright"}))
      ->capture_default_str();
  command.add_flag("--scale", args.scale, "Estimate a scale of the readings as well (not with spots alone)");
  const auto sigma = [&](const char* name, double& value, const char* help) {
    command.add_option(name, value, help)->check(positive_number());
  };
  sigma("--sigma-px", args.sigma_px, "σ of a spot's coordinate [px] (default: told by photo or residuals)");
  sigma("--sigma-range-m", args.sigma_range_m, "σ of a reading [m] (default: told by the residuals)");
  const auto sigma_or_exact = [&](const char* name, std::optional<double>& value, const char* help) {
    command.add_option(name, value, help)->check(finite_number() & CLI::Range(0.0, 1.0));
  };
  sigma_or_exact("--sigma-square", args.sigma_square_m, "σ of the length of the board's squares [m]; 0: exact");
  sigma_or_exact("--sigma-scale", args.sigma_scale,
                 "σ of the scale of the readings, which is then held at 1; 0: exact (default: estimated where it "
                 "matters and can be told)");
  sigma("--sigma-range-per-m", args.sigma_range_per_m, "What it grows by for each metre of range");
  sigma("--sigma-incidence-m", args.sigma_incidence_m, "What it grows by with tan of the angle of incidence [m]");
  command.add_option("--outliers", args.outliers, "drop: leave out shots that no noise explains, by name; keep")
      ->check(CLI::IsMember({"drop", "keep"}))
      ->capture_default_str();
  command.add_flag("--skip-bad", args.skip_bad, "Leave out rows that are wrong, by name, instead of stopping");
}

}  // namespace

void add_rangefinder(App& app) {
  auto args = std::make_shared<RangefinderArgs>();
  CLI::App& command = app.add_command(
      {.name = "rangefinder",
       .summary = "Origin and direction of a laser rangefinder's beam in a camera",
       .examples = "alidade rangefinder shots.csv --camera camera.yaml --board 9x6 --square 0.04\n"
                   "alidade rangefinder shots.csv --camera camera.yaml --method spot --spot red\n"
                   "alidade rangefinder shots.csv --camera camera.yaml --method plane --scale --sigma-range-m 0.01\n"},
      [args](Run& run) { return rangefinder(*args, run); });
  add_options(command, *args);
}

}  // namespace alidade::cli
