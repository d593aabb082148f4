#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "alidade/estimation/median.h"
#include "alidade/geometry/degree.h"
#include "alidade/heads/head_identify.h"

namespace alidade {
namespace {

/// Shown as lies or as facts that a user has to know.
void check_readings(const PositionerFit& fit, const std::string& axis, std::vector<Check>& checks) {
  constexpr double coarse_rad = 0.2 * degree;
  if (fit.resolution.value > coarse_rad)
    checks.push_back(
        {axis + " resolution", State::care,
         fmt::format("{} is read in steps of {:.3g}°: what is finer is lost", axis, fit.resolution.value / degree),
         fit.resolution.value / degree, coarse_rad / degree, "°", ""});
  const double off = std::abs(fit.gain - 1.0), limit = std::max(5.0 * fit.sigma_gain, 0.005);
  if (fit.gain < 0.0) {
    checks.push_back({axis + " sense", State::bad,
                      axis + " is mirrored: what it reads falls where it is commanded to rise", fit.gain, 0.0, "", ""});
  } else if (off > limit) {
    checks.push_back({axis + " gain", State::bad,
                      fmt::format("{} reads {:.4g} rad where 1 rad is commanded", axis, fit.gain), off, limit, "", ""});
  }
  if (fit.reads_target)
    checks.push_back({axis + " reading", State::bad,
                      axis + " reads its target at once: it reports the command, not the position",
                      fit.rate.value / degree, 1000.0, "°/s", ""});
  constexpr double max_noise = 4.0;
  checks.push_back({axis + " residuals", fit.noise > max_noise ? State::care : State::good,
                    fmt::format("{}: readings scatter by {:.2g} of what its steps and its clock explain, {:.2g}° RMS",
                                axis, fit.noise, fit.rms_rad / degree),
                    fit.noise, max_noise, "", ""});
}

/// What the log did not show.
std::string not_given(const PositionerFit& fit) {
  std::string text;
  const auto add = [&](const std::string& what) { text += (text.empty() ? "" : ", ") + what; };
  if (!fit.reached_rate)
    add(fmt::format("the largest rate (it had no way to reach it: {:.3g}°/s and more)", fit.fastest_rad_s / degree));
  if (!fit.acceleration.is_asked_for) add("an acceleration (starts and stops are too quick to be seen)");
  if (!fit.time_constant.is_asked_for) add("a time constant");
  if (!fit.backlash.is_asked_for) add(fmt::format("backlash (below {:.2g}°)", 3.0 * fit.backlash.sigma / degree));
  if (!fit.dead_band.is_asked_for)
    add(std::isfinite(fit.dead_band.sigma)
            ? fmt::format("a dead band (below {:.2g}°)", std::sqrt(3.0) * fit.dead_band.sigma / degree)
            : "a dead band (no room for small steps)");
  return text;
}

/// Where commands end, on a grid that is coarser than what is read.
void check_grid(const PositionerLog& log, const PositionerFit& fit, const std::string& axis,
                std::vector<Check>& checks) {
  constexpr double coarse_rad = 0.2 * degree;
  const double grid = command_step(log);
  if (!(grid > std::max(coarse_rad, 4.0 * fit.resolution.value))) return;
  checks.push_back({axis + " steps", State::bad,
                    fmt::format("{} moves in steps of {:.3g}°: commands between are rounded", axis, grid / degree),
                    grid / degree, coarse_rad / degree, "°", ""});
}

/// Where it came to rest, beside where it was sent: by more than any of its own flaws, so often.
void check_rests(const PositionerLog& log, const PositionerFit& fit, const std::string& axis,
                 std::vector<Check>& checks) {
  constexpr double far_rad = 1.0 * degree, rest_s = 0.3;
  const double limit = far_rad + 2.0 * fit.resolution.value + fit.backlash.value + fit.dead_band.value;
  std::vector<double> off;
  for (std::size_t k = 0; k < log.commands.size(); ++k) {
    const double end_s = k + 1 < log.commands.size() ? log.commands[k + 1].t_s : 1e300;
    const auto next = std::ranges::lower_bound(log.readings, end_s, {}, &PositionerReading::t_s);
    if (next == log.readings.begin() || (next - 1)->t_s - log.commands[k].t_s < 2.0 * rest_s) continue;
    const PositionerReading& last = *(next - 1);
    const bool rests = std::all_of(log.readings.begin(), next, [&](const PositionerReading& each) {
      return each.t_s < last.t_s - rest_s || each.angle_rad == last.angle_rad;
    });
    if (rests) off.push_back(last.angle_rad - log.commands[k].target_rad);
  }
  const bool is_explained = std::ranges::any_of(
      checks, [&](const Check& check) { return check.state == State::bad && check.name.starts_with(axis + " "); });
  if (off.size() < 5 || is_explained) return;
  const double usual = median_of(off);
  double most = 0.0;
  std::size_t beside = 0;
  for (const double each : off) {
    most = std::max(most, std::abs(each - usual));
    beside += std::abs(each - usual) > limit;
  }
  if (beside < 2) return;
  checks.push_back(
      {axis + " rests", State::bad,
       fmt::format("{} came to rest up to {:.2g}° beside where it was sent, after {} of {} commands: somebody "
                   "else moves it, or it does not hold",
                   axis, most / degree, beside, off.size()),
       most / degree, limit / degree, "°", ""});
}

/// Readings that are older than they seem.
void check_renewal(const PositionerFit& fit, const std::string& axis, std::vector<Check>& checks) {
  if (fit.renewal_s == 0.0) return;
  checks.push_back({axis + " renewal", State::care,
                    fmt::format("{} is updated every {:.2g} s only (a cached status): its acceleration and time "
                                "constant are of readings that are up to so old",
                                axis, fit.renewal_s),
                    fit.renewal_s, 0.15, "s", ""});
}

/// The options of the axes that lack room; where their range is the head's own, that no option helps.
std::string more_room(const HeadIdentification& identified, const std::array<bool, 2>& lacks) {
  std::string options, own;
  const auto add = [](std::string& text, const std::string& what) { text += (text.empty() ? "" : " and ") + what; };
  for (std::size_t i = 0; i < 2; ++i) {
    const std::string axis = head_axis_names[i];
    if (!lacks[i]) continue;
    if (identified.at_own_limits[i])
      add(own, axis);
    else
      add(options, "--" + axis + "-range LOW,HIGH");
  }
  if (!options.empty()) return "give it more room: " + options;
  return own.empty() ? "" : "the head's own limits leave " + own + " no more room";
}

Verdict refusal_of(const HeadIdentification& identified, std::size_t i) {
  const std::string axis = head_axis_names[i];
  Verdict verdict;
  verdict.state = State::refused;
  verdict.exit_code = ExitCode::undetermined;
  verdict.sentence = identified.axes[i].status == PositionerFit::Status::no_motion
                         ? axis + " does not move: commands are taken, and the reading is frozen"
                         : axis + ": too few readings";
  verdict.to_add = more_room(identified, {i == 0, i == 1});
  return verdict;
}

/// It was not allowed to go as far as would show anything: no fault of the head's is seen.
Verdict cramped_verdict(const HeadIdentification& identified) {
  Verdict verdict;
  verdict.state = State::refused;
  verdict.exit_code = ExitCode::undetermined;
  for (Eigen::Index i = 0; i < 2; ++i) {
    if (!identified.cramped[static_cast<std::size_t>(i)]) continue;
    const double low = identified.low_rad[i] / degree, high = identified.high_rad[i] / degree;
    verdict.sentence += fmt::format(
        "{}{} {} between {:.4g}° and {:.4g}°", verdict.sentence.empty() ? "" : "; ",
        head_axis_names[static_cast<std::size_t>(i)],
        high > low ? "did not move, and had too little room to show why," : "has no room to move", low, high);
  }
  verdict.to_add = more_room(identified, identified.cramped);
  return verdict;
}

}  // namespace

double command_step(const PositionerLog& log) {
  constexpr double rest_s = 0.2, min_share = 0.12;
  constexpr std::size_t fewest = 8;
  std::vector<PositionerReading> rests;
  std::vector<double> off;
  for (std::size_t k = 0; k < log.commands.size(); ++k) {
    const double end_s = k + 1 < log.commands.size() ? log.commands[k + 1].t_s : 1e300;
    const auto next = std::ranges::lower_bound(log.readings, end_s, {}, &PositionerReading::t_s);
    if (next == log.readings.begin()) continue;
    const PositionerReading& last = *(next - 1);
    const bool rests_there = last.t_s - log.commands[k].t_s > 2.0 * rest_s &&
                             std::all_of(log.readings.begin(), next, [&](const PositionerReading& each) {
                               return each.t_s < last.t_s - rest_s || each.angle_rad == last.angle_rad;
                             });
    if (!rests_there) continue;
    rests.push_back(last);
    off.push_back(last.angle_rad - log.commands[k].target_rad);
  }
  if (rests.size() < fewest) return 0.0;
  const double step = reading_step(rests), grain = reading_step(log.readings);
  double sum2 = 0.0;
  for (std::size_t i = 0; i < rests.size(); ++i) {
    const double steps = (rests[i].angle_rad - rests.front().angle_rad) / step;
    if (!(std::abs(steps - std::round(steps)) * step < 0.6 * grain + 0.01 * step)) return 0.0;
    sum2 += off[i] * off[i];
  }
  // Rounded, they end beside their targets by up to half a step.
  return std::sqrt(sum2 / static_cast<double>(rests.size())) > min_share * step ? step : 0.0;
}

namespace {

bool lacks_room(const PositionerFit& fit) { return !fit.reached_rate || !std::isfinite(fit.dead_band.sigma); }

void judge_axis(const HeadIdentification& identified, std::size_t i, Verdict& verdict) {
  const PositionerFit& fit = identified.axes[i];
  const std::string axis = head_axis_names[i], missing = not_given(fit);
  check_readings(fit, axis, verdict.checks);
  check_grid(identified.logs[i], fit, axis, verdict.checks);
  check_rests(identified.logs[i], fit, axis, verdict.checks);
  check_renewal(fit, axis, verdict.checks);
  verdict.sentence += fmt::format("{}{} follows at up to {:.4g}°/s, {:.3g} ms late", i == 0 ? "" : "; ", axis,
                                  fit.rate.value / degree, 1e3 * fit.latency.value);
  if (!fit.reached_rate) verdict.sentence += ", and had no way to reach its largest rate";
  verdict.checks.push_back(
      {axis + " excitation", lacks_room(fit) ? State::care : State::good,
       missing.empty() ? axis + ": all of the model was excited" : axis + ": the log does not show " + missing});
}

/// The worst check's state. What is wrong comes first; of values that are not to be trusted nothing is said.
void sum_up(Verdict& verdict) {
  std::string named;
  for (const Check& check : verdict.checks) {
    if (check.state == State::good) continue;
    const bool is_named =
        check.state == State::bad || check.name.ends_with("resolution") || check.name.ends_with("renewal");
    if (is_named) named += (named.empty() ? "" : "; ") + check.text;
    if (check.state == State::bad) {
      verdict.state = State::bad;
      verdict.exit_code = ExitCode::not_trusted;
    } else if (verdict.state == State::good) {
      verdict.state = State::care;
    }
  }
  if (verdict.state == State::bad) {
    verdict.sentence = named;
  } else if (!named.empty()) {
    verdict.sentence += "; " + named;
  }
}

}  // namespace

Verdict head_verdict(const HeadIdentification& identified) {
  Verdict verdict;
  if (!identified.lie.empty()) {
    verdict.state = State::refused;
    verdict.exit_code = ExitCode::undetermined;
    verdict.sentence = identified.lie;
    verdict.to_add = "look whether it moves; mend that first";
    return verdict;
  }
  if (identified.cramped[0] || identified.cramped[1]) return cramped_verdict(identified);
  for (std::size_t i = 0; i < 2; ++i)
    if (identified.axes[i].status != PositionerFit::Status::ok) return refusal_of(identified, i);
  for (std::size_t i = 0; i < 2; ++i) judge_axis(identified, i, verdict);
  verdict.to_add = more_room(identified, {lacks_room(identified.axes[0]), lacks_room(identified.axes[1])});
  sum_up(verdict);
  judge_zoom(identified.zoom, verdict);
  return verdict;
}

}  // namespace alidade
