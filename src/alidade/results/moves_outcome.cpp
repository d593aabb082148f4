#include "alidade/results/moves_outcome.h"

#include <fmt/format.h>

#include <array>
#include <cmath>

#include "alidade/geometry/degree.h"

namespace alidade {
namespace {

DataTable moves_table(const std::vector<NextMove>& moves) {
  static constexpr std::array names{"pan_rad",     "tilt_rad",    "roll_rad",    "duration_s",
                                    "sigma_fx_px", "sigma_fy_px", "sigma_cx_px", "sigma_cy_px"};
  std::array<std::vector<double>, names.size()> columns;
  for (const NextMove& move : moves) {
    Eigen::Matrix<double, names.size(), 1> row;
    row << move.pan_tilt_roll_rad, move.duration_s, move.sigma_px;
    for (std::size_t i = 0; i < names.size(); ++i) columns[i].push_back(row[static_cast<Eigen::Index>(i)]);
  }
  DataTable table{.name = "next"};
  for (std::size_t i = 0; i < names.size(); ++i) table.columns.emplace_back(names[i], columns[i]);
  return table;
}

std::string move_line(const NextMove& move, std::size_t number, bool can_roll) {
  const std::string roll = can_roll ? fmt::format(", roll {:+.1f}°", move.pan_tilt_roll_rad.z() / degree) : "";
  return fmt::format(
      "move {}: pan {:+.1f}°, tilt {:+.1f}°{} from here, {:.1f} s: 3σ of fx {:.2g}, fy {:.2g}, cx {:.2g}, cy {:.2g} px",
      number, move.pan_tilt_roll_rad.x() / degree, move.pan_tilt_roll_rad.y() / degree, roll, move.duration_s,
      3.0 * move.sigma_px[0], 3.0 * move.sigma_px[1], 3.0 * move.sigma_px[2], 3.0 * move.sigma_px[3]);
}

}  // namespace

JobOutcome outcome_of(const MovePlan& plan) {
  JobOutcome outcome;
  ResultDocument& document = outcome.document;
  document.command = "plan observe";
  document.counts = plan.counts;
  document.verdict = plan.verdict;
  if (plan.moves.empty()) return outcome;
  for (std::size_t i = 0; i < plan.moves.size(); ++i) {
    outcome.lines.push_back(move_line(plan.moves[i], i + 1, plan.config.roll));
  }
  document.data.push_back(moves_table(plan.moves));
  JsonValue camera = JsonValue::object();
  camera["width"] = plan.now.width_px;
  camera["height"] = plan.now.height_px;
  static const char* const names[] = {"fx", "fy", "cx", "cy"};
  for (int i = 0; i < 4; ++i) {
    camera[names[i]] = plan.now.k_px[i];
    document.estimate["sigma_now_px"][names[i]] = std::sqrt(plan.now.cov_px2(i, i));
    document.estimate["sigma_planned_px"][names[i]] = plan.moves.back().sigma_px[i];
  }
  document.estimate["camera"] = std::move(camera);
  return outcome;
}

}  // namespace alidade
