#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "alidade/geometry/degree.h"
#include "alidade/loop/servo_loop.h"
#include "alidade/pantilt/head.h"
#include "alidade/reproduce/xiahou_experiments.h"
#include "alidade/simulate/draws.h"
#include "alidade/track/xiahou_filter.h"

// Figure 2 of the paper: angles → tangents → filter → projection with the same angles → error → PI → plant → angles,
// with d1 to d4 added to the four angles. No image of the target comes in anywhere.

namespace alidade::reproduce {
namespace {

constexpr double loop_step_s = 0.05, loop_radius_m = 0.1, loop_period_s = 10.0;
constexpr int loop_steps = 240;
constexpr double loop_baseline_cm = 50.2;
const Eigen::Vector2d loop_centre_px(160.0, 120.0);

/// One instant: what is fed back, where the target truly is in both images, and the angles of both heads.
struct LoopStep {
  double t_s = 0.0;
  std::array<Eigen::Vector2d, 2> fed_back_px, true_px, pan_tilt_rad, to_target_rad;
};

Eigen::Vector3d loop_target_m(double t_s) {
  const double angle = 2.0 * std::numbers::pi * t_s / loop_period_s;
  return paper_target_cm / 100.0 + loop_radius_m * Eigen::Vector3d(std::cos(angle) - 1.0, std::sin(angle), 0.0);
}

std::array<RigHead, 2> loop_rig() {
  std::array<RigHead, 2> rig = xiahou_rig();
  rig[1].head.world_from_base.translation.x() = loop_baseline_cm / 100.0;
  return rig;
}

/// The paper's controller and plant on one axis, about the angle that it starts at.
class PrintedAxis {
 public:
  double advance(double error_px) {
    const double command = gains_.kp * error_px + gains_.ki * integral_;
    integral_ += loop_step_s * error_px;
    motion_ = advanced(axis_, motion_, command, loop_step_s);
    return motion_.angle_rad;
  }

 private:
  PiGains gains_;
  ServoAxis axis_;
  AxisMotion motion_;
  double integral_ = 0.0;
};

std::vector<LoopStep> run_printed_loop(double sigma_d_rad, std::uint64_t seed) {
  const std::array<RigHead, 2> rig = loop_rig();
  Draws draws(seed);
  XiahouFilter filter({.baseline_cm = loop_baseline_cm}, paper_target_cm);
  std::array<std::array<PrintedAxis, 2>, 2> axes;
  std::array<Eigen::Vector2d, 2> start_rad, output_rad{Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero()};
  for (std::size_t i = 0; i < 2; ++i) start_rad[i] = *aim(rig[i].head, loop_target_m(0.0));
  std::vector<LoopStep> steps;
  for (int k = 1; k <= loop_steps; ++k) {
    LoopStep step;
    step.t_s = loop_step_s * k;
    const Eigen::Vector3d target_m = loop_target_m(step.t_s);
    for (std::size_t i = 0; i < 2; ++i)
      step.pan_tilt_rad[i] = start_rad[i] + output_rad[i] + sigma_d_rad * draws.normal2();
    const auto measured = pseudo_measurement(step.pan_tilt_rad[0], step.pan_tilt_rad[1], loop_baseline_cm);
    if (measured) filter.step(*measured, loop_step_s);
    for (std::size_t i = 0; i < 2; ++i) {
      const Eigen::Matrix<double, 3, 4> M = projection_matrix(rig[i], step.pan_tilt_rad[i]);
      step.fed_back_px[i] = (M * (filter.position_cm() / 100.0).homogeneous()).hnormalized();
      step.true_px[i] = (M * target_m.homogeneous()).hnormalized();
      step.to_target_rad[i] = aim(rig[i].head, target_m).value_or(start_rad[i]);
      for (std::size_t axis = 0; axis < 2; ++axis) {
        const auto a = static_cast<Eigen::Index>(axis);
        output_rad[i][a] = axes[i][axis].advance(loop_centre_px[a] - step.fed_back_px[i][a]);
      }
    }
    steps.push_back(step);
  }
  return steps;
}

double share_in_central_third(const std::vector<LoopStep>& steps, std::array<Eigen::Vector2d, 2> LoopStep::*pixels) {
  double num = 0.0;
  for (const LoopStep& step : steps)
    for (const Eigen::Vector2d& px : step.*pixels) {
      const Eigen::Vector2d off = (px - loop_centre_px).cwiseAbs();
      num += off.x() <= 320.0 / 6.0 && off.y() <= 240.0 / 6.0 ? 0.5 : 0.0;
    }
  return 100.0 * num / static_cast<double>(steps.size());
}

/// The largest angle between the start and any later moment, of the first head's pan. [deg]
double travel_deg(const std::vector<LoopStep>& steps, std::array<Eigen::Vector2d, 2> LoopStep::*angles) {
  double most = 0.0;
  for (const LoopStep& step : steps)
    most = std::max(most, std::abs((step.*angles)[0].x() - (steps.front().*angles)[0].x()));
  constexpr double min_deg = 1e-9;  // rounding is no travel
  return most / degree > min_deg ? most / degree : 0.0;
}

FigureTable loop_figure(const std::vector<LoopStep>& steps) {
  FigureTable figure{
      "2", {{"t_s", {}}, {"fed_back_u1_px", {}}, {"true_u1_px", {}}, {"pan1_deg", {}}, {"target_pan1_deg", {}}}};
  for (const LoopStep& step : steps) {
    const std::array<double, 5> row{step.t_s, step.fed_back_px[0].x(), step.true_px[0].x(),
                                    step.pan_tilt_rad[0].x() / degree, step.to_target_rad[0].x() / degree};
    for (std::size_t i = 0; i < row.size(); ++i) figure.columns[i].second.push_back(row[i]);
  }
  return titled(std::move(figure), "The loop as printed: what is fed back, and where the target is",
                "First head, one run. Above: u of the projected estimate, which is fed back, and of the target's true "
                "image. Below: the pan angle, and the one at which the head would look at the target.");
}

/// Medians over runs with d1 to d4.
struct LoopShares {
  double fed_back_percent = 0.0, true_percent = 0.0;
};

LoopShares loop_shares(const ReproduceConfig& config, double sigma_d_rad) {
  std::vector<double> fed_back, truth;
  for (std::uint64_t run = 0; run < (config.quick ? 5u : 40u); ++run) {
    report_progress(config.progress, "figure 2", run, config.quick ? 5 : 40);
    const std::vector<LoopStep> steps = run_printed_loop(sigma_d_rad, 300 * config.seed + run);
    fed_back.push_back(share_in_central_third(steps, &LoopStep::fed_back_px));
    truth.push_back(share_in_central_third(steps, &LoopStep::true_px));
  }
  return {quantile_of(fed_back, 0.5), quantile_of(truth, 0.5)};
}

/// How far the first head pans.
double pan_travel_deg(const ServoRun& run) {
  double most = 0.0;
  for (const ServoRow& row : run.rows)
    if (row.head == 0)
      most = std::max(most, std::abs(row.measured_rad.x() - run.rows.front().measured_rad.x()) / degree);
  return most;
}

/// The claims, by the loop as printed with (shares) and without disturbances, and by ours.
std::vector<Claim> loop_claims(const LoopShares& shares, const ServoRun& ours) {
  const std::vector<LoopStep> quiet = run_printed_loop(0.0, 1);
  const double target_deg = travel_deg(quiet, &LoopStep::to_target_rad);
  Claim fed_back{"loop-fed-back", "what is fed back stays in the central third of both images", "%", not_a_number,
                 shares.fed_back_percent};
  fed_back.holds = near_to(fed_back.rerun, 100.0, 0.01);
  fed_back.words =
      "This holds wherever the target is, because the estimate is projected with the angles from which it was "
      "computed.";
  Claim follows{"loop-follows",
                "the loop as printed keeps the target in the central third of both images",
                "%",
                not_a_number,
                shares.true_percent,
                100.0 * ours.figures.central_third};
  follows.holds = near_to(follows.rerun, 100.0, 0.01);
  follows.words = "The target's true image, which no part of figure 2 uses. Ours: measured pixels, 0.5 px.";
  Claim moves{"loop-moves",
              "the heads follow the target where d1 to d4 are zero: travel of the first pan",
              "°",
              not_a_number,
              travel_deg(quiet, &LoopStep::pan_tilt_rad),
              pan_travel_deg(ours)};
  moves.holds = near_to(moves.rerun, target_deg, 0.1);
  moves.words = fmt::format("The target's own is {:.1f}°. All that moves this loop is d1 to d4.", target_deg);
  for (Claim* claim : {&fed_back, &follows, &moves}) claim->figure = "2";
  return {fed_back, follows, moves};
}

}  // namespace

Experiment xiahou_loop(const ReproduceConfig& config) {
  constexpr double sigma_d_rad = 0.5 * degree;
  const LoopShares shares = loop_shares(config, sigma_d_rad);
  return {
      "loop",
      "Figure 2: the loop as printed",
      "Angles with d1 to d4 added give the tangents of the measurement; the filter (Q = I6) takes them; its estimate, "
      "projected with the same angles, is what the PI controllers compare with the image centre.",
      "d1 to d4: white, 0.5°; the paper does not say what they are. Plant in degrees, error in pixels, circle of 10 "
      "cm in 10 s, which enters nowhere but in the true image.",
      loop_claims(shares, run_servo(xiahou_servo_scene(), {}, config.seed)),
      {loop_figure(run_printed_loop(sigma_d_rad, 300 * config.seed))}};
}

}  // namespace alidade::reproduce
