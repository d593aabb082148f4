#include "alidade/observe/move_plan.h"

#include <fmt/format.h>

#include <cmath>

#include "alidade/estimation/config_error.h"
#include "alidade/geometry/degree.h"
#include "alidade/observe/next_move.h"

namespace alidade {
namespace {

constexpr const char* unmeasured = "moves are planned of a head or gimbal whose rotation is measured; this one was not";

std::string now_fault(const ObservedNow& now) {
  if (now.width_px < 1 || now.height_px < 1) return "the size of the images must be given";
  if (!now.k_px.allFinite() || !(now.k_px.head<2>().minCoeff() > 0.0)) return "the focal lengths must be above zero";
  if (!(now.sigma_px > 0.0) || !std::isfinite(now.sigma_px)) return "σ of a pixel must be above zero";
  const bool is_covariance = now.cov_px2.allFinite() && now.cov_px2.diagonal().minCoeff() > 0.0;
  if (!is_covariance) return "the covariance of fx, fy, cx, cy must be positive definite";
  if (!(now.frames_per_s > 0.0) || !std::isfinite(now.frames_per_s)) return "there must be frames in a second";
  if (now.source == RotationSource::none || !std::isfinite(now.sigma_angle_rad)) return unmeasured;
  for (const Eigen::Vector2d& px : now.points_px) {
    if (!px.allFinite()) return "a point is not at finite pixels";
  }
  return "";
}

Verdict moves_verdict(const MovePlan& plan, const MoveLimits& limits) {
  Verdict verdict;
  if (plan.moves.empty()) {
    verdict.state = State::refused;
    verdict.exit_code = ExitCode::undetermined;
    if (!is_short_enough(shortest_way_rad(limits), limits)) {
      verdict.sentence = fmt::format("no move can be proposed: at {:.2g}°/s the shortest, of {:.2g}°, takes {:.2g} s",
                                     plan.config.rate_deg_s, shortest_way_rad(limits) / degree,
                                     shortest_way_rad(limits) / limits.rate_rad_per_s);
      verdict.to_add = "raise --rate-deg-s, or lower --max-turn-deg";
      return verdict;
    }
    verdict.sentence = "no move can be proposed: this camera sees no point that tells more of it";
    verdict.to_add = "track points first";
    return verdict;
  }
  const Eigen::Vector4d before = 3.0 * plan.now.cov_px2.diagonal().cwiseSqrt(),
                        after = 3.0 * plan.moves.back().sigma_px;
  verdict.sentence = fmt::format("{} moves lower 3σ of fx from {:.2g} to {:.2g} px, of fy from {:.2g} to {:.2g} px",
                                 plan.moves.size(), before[0], after[0], before[1], after[1]);
  heed_gain(after.cwiseQuotient(before).minCoeff(), "raise --max-turn-deg, or track more points first", verdict);
  return verdict;
}

}  // namespace

FieldList fields_of(MoveConfig& config) {
  return {{.name = "moves", .value = &config.moves, .help = "Number of rotations to propose", .limits = {1, 20}},
          {.name = "rate_deg_s",
           .value = &config.rate_deg_s,
           .help = "Rate of each axis [deg/s]",
           .limits = {.min = 0.0, .is_above_min = true},
           .option = "--rate-deg-s"},
          {.name = "max_turn_deg",
           .value = &config.max_turn_deg,
           .help = "Maximum rotation from the current position [deg]",
           .limits = {0.1, 85.0},
           .option = "--max-turn-deg"},
          {.name = "roll", .value = &config.roll, .help = "The head can roll as well"}};
}

MovePlan plan_moves(const ObservedNow& now, const MoveConfig& config, const Progress& progress) {
  MovePlan plan{.now = now, .config = config};
  std::vector<std::string> faults = faults_of(fields_of(plan.config));
  if (const std::string fault = now_fault(now); !fault.empty()) faults.push_back(fault);
  if (!faults.empty()) throw ConfigError(fmt::format("{}", fmt::join(faults, "; ")));
  const MoveLimits limits{config.rate_deg_s * degree, config.max_turn_deg * degree, config.roll, now.frames_per_s};
  plan.moves = plan_next_moves(now, limits, config.moves, progress);
  if (!plan.moves.empty()) plan.counts.given = plan.counts.used = 1;
  plan.verdict = moves_verdict(plan, limits);
  return plan;
}

ObservedNow observed_now(const ObserveReport& report) {
  const ExitCode code = report.verdict.exit_code;
  const bool has_answer = code == ExitCode::ok || code == ExitCode::not_trusted;
  if (report.quantities.size() < 4 || !has_answer) {
    throw ConfigError("this observation was refused: " + report.verdict.to_add);
  }
  if (report.log.source == RotationSource::none) throw ConfigError(unmeasured);
  ObservedNow now;
  now.width_px = report.width_px;
  now.height_px = report.height_px;
  now.sigma_px = report.sigma_px;
  now.cov_px2 = report.covariance.topLeftCorner<4, 4>();
  for (int i = 0; i < 4; ++i) now.k_px[i] = report.quantities[static_cast<std::size_t>(i)].value;
  for (int i = 0; i < 4; ++i) now.sigma_model_px[i] = report.quantities[static_cast<std::size_t>(i)].sigma_model;
  now.design_effect = report.shared_errors.design_effect;
  now.source = report.log.source;
  now.sigma_angle_rad = report.sigma_angle_rad;
  now.sigma_rate_rad_per_s = report.sigma_rate_rad_per_s;
  const std::vector<RotationRow>& rows = report.log.rows;
  const double seconds = rows.empty() ? 0.0 : rows.back().t_s - rows.front().t_s;
  if (seconds > 0.0) now.frames_per_s = static_cast<double>(rows.size() - 1) / seconds;
  now.assumed = report.assumed;
  for (const ObservedQuantity& quantity : report.quantities)
    assume_estimated(quantity.name, quantity.sigma, now.assumed);
  now.points_px = points_at_end(report.residuals, now.frames_per_s);
  return now;
}

}  // namespace alidade
