#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <mutex>
#include <opencv2/core.hpp>
#include <set>

#include "alidade/board_detector/find_boards.h"
#include "alidade/formats/camera_file.h"
#include "alidade/formats/rig_file.h"
#include "alidade/geometry/degree.h"
#include "alidade/images/photos.h"
#include "alidade/results/rig_document.h"
#include "alidade/rig/rig.h"
#include "alidade/tables/views_file.h"
#include "cli/app/app.h"
#include "cli/app/board_options.h"
#include "cli/app/option_checks.h"
#include "cli/commands/commands.h"
#include "cli/commands/rig_moving.h"

namespace alidade::cli {
namespace {

struct RigArgs {
  std::filesystem::path views;
  std::vector<std::filesystem::path> cameras;
  Board board = no_board();
  double sigma_px = 0.0, sigma_angle_rad = 0.0, sigma_square_m = 0.0, sigma_scale = 0.0;
  bool scales = false, skip_bad = false;
  std::string outliers = "drop";
  std::vector<std::string> estimate{"auto"};
  MovingTargetArgs moving;
};

RigConfig config_from(const RigArgs& args) {
  RigConfig config;
  if (args.sigma_px > 0.0) config.sigma_px = args.sigma_px;
  if (args.sigma_angle_rad > 0.0) config.sigma_encoder_rad = args.sigma_angle_rad;
  if (args.sigma_square_m > 0.0) config.sigma_square_m = args.sigma_square_m;
  if (args.sigma_scale > 0.0) config.sigma_scale = args.sigma_scale;
  config.square_m = args.board.square_m;
  config.estimate_scales = args.scales;
  for (const std::string& what : args.estimate) {
    if ((what == "auto" || what == "none") && args.estimate.size() > 1)
      throw UsageError("--estimate: '" + what + "' stands alone");
    config.estimate_by_need |= what == "auto";
    config.estimate_scales |= what == "scale";
    config.estimate_once |= what == "once";
    config.estimate_backlash |= what == "backlash";
    config.estimate_focal |= what == "focal";
    config.estimate_centre |= what == "centre";
  }
  if (config.estimate_scales && config.sigma_scale)
    throw UsageError("scales that are estimated have no --sigma-scale; give one of them");
  config.reject_outliers = args.outliers == "drop";
  return config;
}

/// One camera for all heads, or one for each in the order of their numbers.
std::map<int, Camera> cameras_of(const RigArgs& args, const std::vector<HeadView>& views) {
  std::set<int> ids;
  for (const HeadView& view : views) ids.insert(view.head);
  if (args.cameras.size() != 1 && args.cameras.size() != ids.size())
    throw InputError(fmt::format("{}: has {} heads ({}), but there are {} cameras; give one, or one for each head",
                                 args.views.string(), ids.size(), fmt::join(ids, ", "), args.cameras.size()));
  std::map<int, Camera> cameras;
  std::size_t next = 0;
  for (const int id : ids) {
    cameras[id] = read_central_camera(args.cameras[next]);
    if (args.cameras.size() > 1) ++next;
  }
  return cameras;
}

/// Corners of the boards in the views' photos; a path is relative to the table's. A photo without a board is named.
void find_corners(const RigArgs& args, const Board& board, const std::map<int, Camera>& cameras,
                  std::vector<HeadView>& views, Run& run) {
  std::mutex mutex;
  std::vector<std::string> faults(views.size());
  const auto load = [&](std::size_t i) -> cv::Mat {
    const std::filesystem::path file = args.views.parent_path() / views[i].seen.photo;
    try {
      const std::string bytes = read_file(file);
      {
        const std::scoped_lock lock(mutex);
        run.add_input("photo", file.string(), bytes);
      }
      cv::Mat photo = decode_photo(bytes);
      const Camera& camera = cameras.at(views[i].head);
      if (photo.cols != camera.width_px || photo.rows != camera.height_px)
        throw InputError(fmt::format("is {}x{}, the camera of head {} is for {}x{}", photo.cols, photo.rows,
                                     views[i].head, camera.width_px, camera.height_px));
      return photo;
    } catch (const InputError& error) {
      faults[i] = error.what();
      throw;
    }
  };
  const BoardDetections found = find_boards(views.size(), load, board, false, run.progress);
  std::vector<HeadView> seen;
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (!faults[i].empty() && !args.skip_bad)
      throw InputError(fmt::format("{}: photo '{}': {}", args.views.string(), views[i].seen.photo, faults[i]));
    if (!faults[i].empty() || !found.photos[i].found()) {
      const std::string& reason = faults[i].empty() ? found.photos[i].reason : faults[i];
      run.say(fmt::format("no board: {}: {}", views[i].seen.photo, reason));
      run.document.counts.skipped.push_back({views[i].seen.photo, 0, reason});
      continue;
    }
    seen.push_back(views[i]);
    seen.back().seen.corners = found.photos[i].view.corners;
  }
  views = std::move(seen);
  run.lap("find_boards");
}

/// A corner beyond the image is of another camera.
void check_images(const RigArgs& args, const std::vector<HeadView>& views, const std::map<int, Camera>& cameras) {
  for (const HeadView& view : views) {
    const Camera& camera = cameras.at(view.head);
    for (const Corner& corner : view.seen.corners) {
      const Eigen::Vector2d& px = corner.px;
      if (px.minCoeff() >= -1.0 && px.x() <= camera.width_px && px.y() <= camera.height_px) continue;
      throw InputError(fmt::format(
          "{}: {}: a corner at ({:.1f}, {:.1f}) is outside the picture of head {}'s camera, {} x {} px: "
          "is it another camera's file?",
          args.views.string(), view.seen.photo, px.x(), px.y(), view.head, camera.width_px, camera.height_px));
    }
  }
}

void summarize(std::span<const HeadView> views, const RigReport& report, bool is_given, Run& run) {
  for (std::size_t v = 0; v < report.views.size() && v < views.size(); ++v) {
    const HeadViewFit& fit = report.views[v];
    if (!fit.used && !fit.reason.empty()) run.say(fmt::format("not used: {}: {}", views[v].seen.photo, fit.reason));
  }
  if (report.status != RigReport::Status::converged) return;
  const Rig& rig = report.rig;
  for (std::size_t h = 0; h < rig.heads.size(); ++h) {
    const Head& head = rig.heads[h].head;
    const HeadVector sigma = 3.0 * rig.cov.diagonal()
                                       .segment<num_head_params>(num_head_params * static_cast<Eigen::Index>(h))
                                       .cwiseMax(0.0)
                                       .cwiseSqrt();
    const Eigen::Vector3d &base = head.world_from_base.translation, &arm = head.tilt_to_cam_m;
    run.say(fmt::format("head {}: base at ({:.1f}, {:.1f}, {:.1f}) ± ({:.2g}, {:.2g}, {:.2g}) mm   (3σ)", head.id,
                        1e3 * base.x(), 1e3 * base.y(), 1e3 * base.z(), 1e3 * sigma[0], 1e3 * sigma[1],
                        1e3 * sigma[2]));
    run.say(fmt::format("  tilt axis {:.2f} ± {:.2g} mm before the pan axis, {:.3f} ± {:.2g}° from square to it",
                        1e3 * head.pan_to_tilt_m.z(), 1e3 * sigma[8], head.axes_skew_rad / degree, sigma[19] / degree));
    run.say(fmt::format("  camera at ({:.2f}, {:.2f}, {:.2f}) ± ({:.2g}, {:.2g}, {:.2g}) mm from the tilt axis",
                        1e3 * arm.x(), 1e3 * arm.y(), 1e3 * arm.z(), 1e3 * sigma[9], 1e3 * sigma[10], 1e3 * sigma[11]));
  }
  for (const RigFreed& one : report.freed)
    run.say(fmt::format("estimated too: {} {:.5g} ± {:.2g}", one.name, one.value, 3.0 * one.sigma));
  run.say(fmt::format("{} of {} views; χ²/dof {:.3f}, rms {:.3f} px; σ of a reading {:.3g}° ({})", report.views_used,
                      report.views.size(), report.chi2_per_dof(), report.rms_px, report.sigma_encoder_rad / degree,
                      report.sigma_encoder_is_told ? "told by the residuals"
                      : is_given                   ? "as given"
                                                   : "assumed"));
}

void add_files(const RigReport& report, Run& run) {
  std::vector<std::string> camera_files;
  for (const RigHead& rig_head : report.rig.heads) {
    camera_files.push_back(fmt::format("camera_{}.yaml", rig_head.head.id));
    run.add_file(camera_files.back(), camera_text(rig_head.camera, CameraFormat::alidade));
  }
  run.add_file("rig.yaml", rig_text(report.rig, camera_files));
}

ExitCode rig(const RigArgs& args, Run& run) {
  if (args.moving.is_asked)
    return rig_by_moving_target(args.views, args.cameras, args.moving, args.sigma_px, args.skip_bad, run);
  if (!is_given(args.board)) throw UsageError("--board is required (or --moving-target, for cameras that do not turn)");
  Board board = args.board;
  require_board(board);
  const RigConfig config = config_from(args);
  run.add_input("views", args.views);
  for (const std::filesystem::path& camera : args.cameras) run.add_input("camera", camera);
  ViewsFile file = read_views(args.views, {.skip_bad = args.skip_bad, .num_points = num_points(board)});
  run.document.counts.skipped = file.skipped;
  run.document.counts.given = file.skipped.size();
  const std::map<int, Camera> cameras = cameras_of(args, file.views);
  run.lap("read");
  if (file.has_photos) {
    find_corners(args, board, cameras, file.views, run);
    run.document.counts.given = run.document.counts.skipped.size();
  }
  check_images(args, file.views, cameras);
  const RigReport report = calibrate_rig(file.views, points_in_board(board), cameras, config, run.progress);
  run.lap("solve");
  const Verdict verdict = rig_verdict(report, config);
  summarize(file.views, report, config.sigma_encoder_rad.has_value(), run);
  fill_rig(file.views, report, run.document);
  if (has_estimate(verdict)) add_files(report, run);
  return run.finish(verdict);
}

}  // namespace

void add_rig(App& app) {
  auto args = std::make_shared<RigArgs>();
  CLI::App& command = app.add_command(
      {.name = "rig",
       .summary = "Axes, offsets and mounting of pan-tilt heads, and where they stand to each other",
       .examples =
           "alidade rig views.csv --camera camera.yaml --board 9x6 --square 0.025\n"
           "alidade rig views.csv --camera left.yaml --camera right.yaml --board 9x6 --square 0.025\n"
           "alidade rig views.csv --camera camera.yaml --board 9x6 --square 0.025 --sigma-angle 0.0003\n"
           "alidade rig sights.csv --moving-target --clocks 60 --truth gnss.csv --camera a.yaml --camera b.yaml\n"},
      [args](Run& run) { return rig(*args, run); });
  command
      .add_option("views", args->views,
                  "Table of views, CSV: view,board,head,pan_rad,tilt_rad with corner,u,v (a row a corner) or photo (a "
                  "row a view); `board` numbers the places where the board stood")
      ->required();
  command
      .add_option("--camera", args->cameras,
                  "The camera of all heads, or one for each head in the order of their numbers")
      ->type_name("FILE")
      ->required()
      ->expected(1)
      ->take_all();
  add_board_options(command, args->board, false);
  add_moving_target_options(command, args->moving);
  command.add_option("--sigma-px", args->sigma_px, "σ of a corner's coordinate [px] (default: told by the residuals)")
      ->check(positive_number());
  command.add_option("--sigma-angle", args->sigma_angle_rad, "σ of an encoder's reading [rad] (default: told as well)")
      ->check(positive_number());
  command.add_option("--sigma-square", args->sigma_square_m, "σ of a square's side [m], counted in the answer's σ")
      ->check(positive_number());
  CLI::Option* sigma_scale =
      command
          .add_option("--sigma-scale", args->sigma_scale, "σ of the encoders' scales (0.001: 0.1 %), counted as well")
          ->check(positive_number());
  command.add_flag("--scales", args->scales, "Estimate the scale of each encoder as well (--estimate scale)")
      ->excludes(sigma_scale);
  command
      .add_option(
          "--estimate", args->estimate,
          "auto: what the residuals ask for, and scales that nobody told; none; or any of scale, once (an error "
          "of one period a turn), backlash (views in the order they were taken), focal, centre (of each lens)")
      ->check(CLI::IsMember({"auto", "none", "scale", "once", "backlash", "focal", "centre"}))
      ->delimiter(',')
      ->capture_default_str();
  command.add_option("--outliers", args->outliers, "drop: leave out views that contradict the others, by name; keep")
      ->check(CLI::IsMember({"drop", "keep"}))
      ->capture_default_str();
  command.add_flag("--skip-bad", args->skip_bad, "Leave out rows that are wrong, by name, instead of stopping");
}

}  // namespace alidade::cli
