#include <fmt/format.h>

#include <cmath>

#include "alidade/geometry/degree.h"
#include "alidade/heads/head_identify.h"

namespace alidade {
namespace {

/// Shown as lies or as facts that a user has to know.
void check_readings(const PositionerFit& fit, const std::string& axis, std::vector<Check>& checks) {
  constexpr double coarse_rad = 0.2 * degree;
  if (fit.resolution.value > coarse_rad)
    checks.push_back({axis + " resolution", State::care,
                      fmt::format("{} is read in steps of {:.3g}°", axis, fit.resolution.value / degree),
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
  constexpr double most_noise = 4.0;
  checks.push_back({axis + " residuals", fit.noise > most_noise ? State::care : State::good,
                    fmt::format("{}: readings scatter by {:.2g} of what its steps and its clock explain, {:.2g}° RMS",
                                axis, fit.noise, fit.rms_rad / degree),
                    fit.noise, most_noise, "", ""});
}

/// What the log did not show.
std::string not_told(const PositionerFit& fit) {
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

Verdict refusal_of(const std::string& axis, const PositionerFit& fit) {
  Verdict verdict;
  verdict.state = State::refused;
  verdict.exit_code = ExitCode::cannot_tell;
  verdict.sentence = fit.status == PositionerFit::Status::no_motion
                         ? axis + " does not move: commands are taken, and the reading stands"
                         : axis + ": too few readings";
  verdict.to_add = "give it more room: --" + axis + "-range LOW,HIGH";
  return verdict;
}

}  // namespace

Verdict head_verdict(const HeadIdentification& identified) {
  for (std::size_t i = 0; i < 2; ++i)
    if (identified.axes[i].status != PositionerFit::Status::ok)
      return refusal_of(head_axis_names[i], identified.axes[i]);
  Verdict verdict;
  for (std::size_t i = 0; i < 2; ++i) {
    const PositionerFit& fit = identified.axes[i];
    const std::string axis = head_axis_names[i], missing = not_told(fit);
    check_readings(fit, axis, verdict.checks);
    verdict.sentence += fmt::format("{}{} follows at up to {:.4g}°/s, {:.3g} ms late", i == 0 ? "" : "; ", axis,
                                    fit.rate.value / degree, 1e3 * fit.latency.value);
    if (!missing.empty()) verdict.sentence += ", the log does not show " + missing;
    const bool lacks = !fit.reached_rate || !std::isfinite(fit.dead_band.sigma);
    verdict.checks.push_back(
        {axis + " excitation", lacks ? State::care : State::good,
         missing.empty() ? axis + ": all of the model was excited" : axis + ": the log does not show " + missing});
    if (lacks) verdict.to_add = "give it more room: --" + axis + "-range LOW,HIGH";
  }
  for (const Check& check : verdict.checks) {
    if (check.state == State::good) continue;
    if (check.state == State::bad) {
      verdict.state = State::bad;
      verdict.exit_code = ExitCode::not_trusted;
      verdict.sentence += "; " + check.text;
    } else if (verdict.state == State::good) {
      verdict.state = State::care;
    }
  }
  return verdict;
}

}  // namespace alidade
