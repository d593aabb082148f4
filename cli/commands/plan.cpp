#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <memory>

#include "alidade/calibrate/next_photo.h"
#include "alidade/formats/camera_json.h"
#include "alidade/geometry/degree.h"
#include "alidade/results/calibration_document.h"
#include "alidade/results/calibration_result.h"
#include "cli/app/app.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct PlanArgs {
  std::filesystem::path result;
  int photos = 3;
};

/// "board's middle at (512, 80) px, 0.61 m away, turned 32° about x, 0° about y".
std::string in_words(const CalibrationResult& known, const NextPhoto& photo) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const auto& point : known.board_points) middle += point / static_cast<double>(known.board_points.size());
  const Eigen::Vector3d middle_in_cam = photo.cam_from_board * middle;
  const Eigen::Vector3d turn = log_so3(photo.cam_from_board.rotation);
  const auto px = project(known.camera, middle_in_cam);
  return fmt::format("board's middle at ({:.0f}, {:.0f}) px, {:.2f} m away, turned {:.0f}° about x, {:.0f}° about y",
                     px ? px->x() : std::nan(""), px ? px->y() : std::nan(""), middle_in_cam.norm(), turn.x() / degree,
                     turn.y() / degree);
}

ExitCode plan_calibrate(const PlanArgs& args, Run& run) {
  const CalibrationResult known = read_calibration(args.result);
  const std::filesystem::path folder =
      std::filesystem::is_directory(args.result) ? args.result : args.result.parent_path();
  run.add_input("result", folder / "result.json");
  run.add_input("camera", folder / "camera.yaml");
  const double shared_noise_px = known.noise_px * std::sqrt(std::max(1.0, known.design_effect));
  const NextPhotoPlan plan =
      plan_next_photos(known.camera, shared_noise_px, known.board_points, args.photos, run.progress);
  Verdict verdict;
  if (plan.photos.empty()) {
    verdict.state = State::refused;
    verdict.exit_code = ExitCode::cannot_tell;
    verdict.sentence = "no board pose can be proposed: this camera has no covariance, or the board fits nowhere";
    verdict.to_add = "calibrate again from photos";
    return run.finish(verdict);
  }
  run.document.estimate["worst_3sigma_px"] = plan.worst_3sigma_px;
  run.document.estimate["planned_worst_3sigma_px"] = plan.photos.back().worst_3sigma_px;
  run.document.estimate["camera"] = camera_values(known.camera);
  run.document.data.push_back(next_photos_table(plan));
  run.document.data.push_back(points_in_board_table(known.board_points));
  run.document.counts.given = run.document.counts.used = 1;
  for (std::size_t i = 0; i < plan.photos.size(); ++i) {
    run.say(fmt::format("photo {}: {}: worst 3σ {:.2f} px", i + 1, in_words(known, plan.photos[i]),
                        plan.photos[i].worst_3sigma_px));
  }
  verdict.sentence =
      fmt::format("{} more photo{} lower the worst 3σ from {:.2g} to {:.2g} px", plan.photos.size(),
                  plan.photos.size() == 1 ? "" : "s", plan.worst_3sigma_px, plan.photos.back().worst_3sigma_px);
  return run.finish(verdict);
}

}  // namespace

void add_plan(App& app) {
  app.add_group("plan", "What to measure next");
  auto args = std::make_shared<PlanArgs>();
  CLI::App& command = app.add_command({.name = "plan calibrate",
                                       .summary = "The board poses whose photos lower the uncertainty most",
                                       .examples = "alidade plan calibrate alidade-out/calibrate --photos 3\n"},
                                      [args](Run& run) { return plan_calibrate(*args, run); });
  command.add_option("result", args->result, "Folder or result.json of a calibration")->required();
  command.add_option("--photos", args->photos, "How many photos to propose")
      ->check(CLI::Range(1, 20))
      ->capture_default_str();
  add_plan_observe(app);
  add_plan_rangefinder(app);
}

}  // namespace alidade::cli
