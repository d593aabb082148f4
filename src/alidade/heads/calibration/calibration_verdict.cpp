#include "alidade/heads/calibration/calibration_verdict.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "alidade/geometry/degree.h"

namespace alidade {
namespace {

/// Frames whose time stamps were of no use: said, and what was taken instead.
void heed_stamps(const HeadCalibration& result, Verdict& verdict) {
  if (result.num_jumps == 0) return;
  Check check{.name = "time stamps",
              .state = State::care,
              .text = fmt::format(
                  "the stream's time stamps jump ({} times, by up to {:.2g} s); what lies between was put together by "
                  "when frames came",
                  result.num_jumps, result.largest_jump_s),
              .value = result.largest_jump_s,
              .unit = "s"};
  verdict.sentence += "; " + check.text;
  verdict.checks.push_back(std::move(check));
  if (verdict.state == State::good) verdict.state = State::care;
}

/// `observe` cannot know whether a camera is rotated about its view or a log's axes are exchanged; of a head the axes
/// are known.
void heed_turned_camera(const HeadCalibration& result, Verdict& verdict) {
  constexpr double mostly = 0.95;
  Eigen::Vector3d mount_rad = Eigen::Vector3d::Zero();
  for (const ObservedQuantity& each : result.report.quantities)
    for (int i = 0; i < 3; ++i)
      if (each.name == fmt::format("mount_{}_rad", "xyz"[i])) mount_rad[i] = each.value;
  if (std::abs(mount_rad.z()) < mostly * mount_rad.norm()) return;
  const auto is_bad = [](const Check& check) { return check.state == State::bad; };
  const auto rotation = std::ranges::find(verdict.checks, "rotation", &Check::name);
  if (std::ranges::count_if(verdict.checks, is_bad) != 1 || rotation == verdict.checks.end() || !is_bad(*rotation))
    return;
  if (!result.report.verdict.to_add.empty() && rotation->text.starts_with("the pixels fit better")) return;
  rotation->state = State::care;
  rotation->text = fmt::format("the camera is turned by {:.1f}° about its view", mount_rad.z() / degree);
  verdict.state = State::care;
  verdict.exit_code = ExitCode::ok;
  verdict.to_add.clear();
}

}  // namespace

Verdict calibration_verdict(const HeadCalibration& result, const HeadCalibrationConfig& config,
                            const Eigen::Vector2d& span_rad) {
  constexpr double held_rad = 0.5 * degree;
  Verdict verdict = result.report.verdict;
  if (!result.fault.empty()) {
    verdict.state = State::refused;
    verdict.exit_code = ExitCode::undetermined;
    verdict.sentence = fmt::format("{}; the head was stopped after {:.0f} s; until then: {}", result.fault,
                                   result.head_time_s, verdict.sentence);
    verdict.to_add = "mend the link and run it again";
    return verdict;
  }
  heed_turned_camera(result, verdict);
  const bool has_answer = verdict.exit_code == ExitCode::ok || verdict.exit_code == ExitCode::not_trusted;
  std::string missing;
  for (std::size_t i = 0; i < 2 && has_answer && config.until; ++i) {
    const ObservedQuantity& f = result.report.quantities[i];
    if (3.0 * f.sigma < *config.until * f.value) continue;
    missing +=
        (missing.empty() ? "" : " and ") + f.name +
        fmt::format(" is known to {:.2g} % (3σ), not to {:.2g} %", 300.0 * f.sigma / f.value, 100.0 * *config.until);
  }
  const bool holds_pan = span_rad[0] < held_rad, holds_tilt = span_rad[1] < held_rad;
  if (!has_answer && (holds_pan || holds_tilt)) {
    verdict.sentence = fmt::format("{} cannot be determined: {} is fixed; {}", holds_tilt ? "fy" : "fx",
                                   holds_tilt ? "tilt" : "pan", verdict.sentence);
    verdict.to_add = fmt::format("give --{}-range more room", holds_tilt ? "tilt" : "pan");
  }
  heed_stamps(result, verdict);
  if (missing.empty()) return verdict;
  verdict.state = State::refused;
  verdict.exit_code = ExitCode::undetermined;
  verdict.sentence = missing + fmt::format(" within the limits, in {:.0f} s", result.head_time_s);
  verdict.to_add = holds_tilt  ? "give --tilt-range more room"
                   : holds_pan ? "give --pan-range more room"
                               : "give more room, or more time: --most SECONDS";
  return verdict;
}

}  // namespace alidade
