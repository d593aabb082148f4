#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "alidade/geometry/degree.h"
#include "alidade/results/observation_result.h"
#include "cli/app/app.h"
#include "cli/app/option_checks.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct PlanObserveArgs {
  std::filesystem::path result;
  int moves = 3;
  double rate_deg_s = 15.0, max_turn_deg = 30.0;
  bool roll = false;
};

DataTable moves_table(const std::vector<NextMove>& moves) {
  std::vector<std::vector<double>> columns(8);
  for (const NextMove& move : moves) {
    for (int i = 0; i < 3; ++i) columns[static_cast<std::size_t>(i)].push_back(move.pan_tilt_roll_rad[i]);
    columns[3].push_back(move.duration_s);
    for (int i = 0; i < 4; ++i) columns[static_cast<std::size_t>(4 + i)].push_back(move.sigma_px[i]);
  }
  return {"next",
          {{"pan_rad", columns[0]},
           {"tilt_rad", columns[1]},
           {"roll_rad", columns[2]},
           {"duration_s", columns[3]},
           {"sigma_fx_px", columns[4]},
           {"sigma_fy_px", columns[5]},
           {"sigma_cx_px", columns[6]},
           {"sigma_cy_px", columns[7]}}};
}

ExitCode plan_observe(const PlanObserveArgs& args, Run& run) {
  const bool is_folder = std::filesystem::is_directory(args.result);
  run.add_input("result", is_folder ? args.result / "result.json" : args.result);
  const ObservedNow now = read_observation(args.result);
  const MoveLimits limits{args.rate_deg_s * degree, args.max_turn_deg * degree, args.roll};
  const std::vector<NextMove> moves = plan_next_moves(now, limits, args.moves, run.progress);
  Verdict verdict;
  if (moves.empty()) {
    verdict.state = State::refused;
    verdict.exit_code = ExitCode::cannot_tell;
    verdict.sentence = "no move can be proposed: no point was seen";
    verdict.to_add = "track points first";
    return run.finish(verdict);
  }
  for (std::size_t i = 0; i < moves.size(); ++i) {
    const NextMove& move = moves[i];
    const std::string roll = args.roll ? fmt::format(", roll {:+.1f}°", move.pan_tilt_roll_rad.z() / degree) : "";
    run.say(fmt::format(
        "move {}: pan {:+.1f}°, tilt {:+.1f}°{} from here, {:.1f} s: 3σ of fx {:.2g}, fy {:.2g}, cx {:.2g}, cy {:.2g} "
        "px",
        i + 1, move.pan_tilt_roll_rad.x() / degree, move.pan_tilt_roll_rad.y() / degree, roll, move.duration_s,
        3.0 * move.sigma_px[0], 3.0 * move.sigma_px[1], 3.0 * move.sigma_px[2], 3.0 * move.sigma_px[3]));
  }
  run.document.data.push_back(moves_table(moves));
  run.document.counts.given = run.document.counts.used = 1;
  JsonValue camera = JsonValue::object();
  camera["width"] = now.width_px;
  camera["height"] = now.height_px;
  static const char* const names[] = {"fx", "fy", "cx", "cy"};
  for (int i = 0; i < 4; ++i) {
    camera[names[i]] = now.k_px[i];
    run.document.estimate["sigma_now_px"][names[i]] = std::sqrt(now.cov_px2(i, i));
    run.document.estimate["sigma_planned_px"][names[i]] = moves.back().sigma_px[i];
  }
  run.document.estimate["camera"] = std::move(camera);
  verdict.sentence = fmt::format("{} moves lower 3σ of fx from {:.2g} to {:.2g} px, of fy from {:.2g} to {:.2g} px",
                                 moves.size(), 3.0 * std::sqrt(now.cov_px2(0, 0)), 3.0 * moves.back().sigma_px[0],
                                 3.0 * std::sqrt(now.cov_px2(1, 1)), 3.0 * moves.back().sigma_px[1]);
  return run.finish(verdict);
}

}  // namespace

void add_plan_observe(App& app) {
  auto args = std::make_shared<PlanObserveArgs>();
  CLI::App& command =
      app.add_command({.name = "plan observe",
                       .summary = "The turns of the head that lower the uncertainty most",
                       .examples = "alidade plan observe alidade-out/observe --moves 3 --rate-deg-s 15\n"},
                      [args](Run& run) { return plan_observe(*args, run); });
  command.add_option("result", args->result, "Folder or result.json of an observation")->required();
  command.add_option("--moves", args->moves, "How many turns to propose")
      ->check(CLI::Range(1, 20))
      ->capture_default_str();
  command.add_option("--rate-deg-s", args->rate_deg_s, "How fast each axis turns")
      ->check(positive_number())
      ->capture_default_str();
  command.add_option("--max-turn-deg", args->max_turn_deg, "How far from here")
      ->check(CLI::Range(0.1, 85.0))
      ->capture_default_str();
  command.add_flag("--roll", args->roll, "The head can roll as well");
}

}  // namespace alidade::cli
