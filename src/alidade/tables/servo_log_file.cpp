#include "alidade/tables/servo_log_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "alidade/files/table_rows.h"
#include "alidade/geometry/degree.h"
#include "alidade/servo/identify/identify_causes.h"

namespace alidade {
ServoLogFile read_servo_log(const std::filesystem::path& file, bool skip_bad) {
  const Csv csv = Csv::read(file, skip_bad);
  const std::string angle = "angle_rad";
  const auto is_there = [&csv](const char* name) { return std::ranges::count(csv.header(), name) > 0; };
  if (is_there("angle_deg") && is_there("angle_rad"))
    throw InputError(csv.name() + ": has both 'angle_rad' and 'angle_deg'");
  for (const std::string& name : {std::string("t_s"), std::string("command"), angle})
    if (!csv.has(name)) throw InputError(csv.name() + ": has no column '" + name + "'; needs t_s,command,angle_rad");
  ServoLogFile read;
  for_each_row(csv, skip_bad, read.skipped, [&](std::size_t row) {
    ServoSample sample{csv.number(row, "t_s"), csv.number(row, "command"), csv.number(row, angle)};
    if (csv.has("command_t_s")) sample.command_t_s = csv.number(row, "command_t_s");
    if (!read.samples.empty() && !(sample.t_s > read.samples.back().t_s))
      throw InputError(csv.where(row, "t_s") + ": '" + csv.text(row, "t_s") + "' is not after the row before it");
    if (!(std::abs(sample.angle_rad) <= 1e4))
      throw InputError(csv.where(row, angle) + ": '" + csv.text(row, angle) + "' is no angle of a servo");
    if (sample.command_t_s > sample.t_s || (!read.samples.empty() && sample.command_t_s < read.samples.back().t_s))
      throw InputError(csv.where(row, "command_t_s") + ": '" + csv.text(row, "command_t_s") +
                       "' is not between the row before it and t_s");
    read.samples.push_back(sample);
  });
  if (read.samples.empty()) throw InputError(file.string() + ": has no rows");
  return read;
}

std::string servo_log_csv(std::span<const ServoSample> samples) {
  const bool has_times =
      std::ranges::any_of(samples, [](const ServoSample& sample) { return std::isfinite(sample.command_t_s); });
  std::string text = has_times ? "t_s,command,angle_rad,command_t_s\n" : "t_s,command,angle_rad\n";
  for (const ServoSample& sample : samples) {
    text += fmt::format("{:.6f},{:.9g},{:.9f}", sample.t_s, sample.command, sample.angle_rad);
    text += has_times ? fmt::format(",{:.6f}\n", sample.given_s()) : "\n";
  }
  return text;
}

std::string servo_plant_text(const ServoFit& fit) {
  const ServoParams sigma = fit.cov.diagonal().cwiseSqrt();
  const bool is_angle = fit.kind == ServoKind::angle;
  std::string flaws, flaw_sigmas;
  for (const std::size_t flaw : fit.freed) {
    const double size = fit.flaws.*servo_flaws[flaw];
    const std::string name = servo_flaw_names[flaw];
    const bool is_of_log =
        servo_flaws[flaw] == &ServoFlaws::clock_rate || servo_flaws[flaw] == &ServoFlaws::earlier_command;
    if (is_of_log) continue;  // not of the axis
    const bool is_of_a_resonance = name.starts_with("resonance");
    if (is_of_a_resonance || servo_flaws[flaw] == &ServoFlaws::max_command ||
        servo_flaws[flaw] == &ServoFlaws::rate_offset_rad_s || servo_flaws[flaw] == &ServoFlaws::soft_max_rate_rad_s ||
        servo_flaws[flaw] == &ServoFlaws::gain_difference || servo_flaws[flaw] == &ServoFlaws::gain_drift ||
        servo_flaws[flaw] == &ServoFlaws::gain_by_size) {
      flaw_sigmas += fmt::format(", {} {:.3g} (no plant has it)", name, size);
      continue;
    }
    const bool is_rad = name.find("rad") != std::string::npos;
    std::string key = name;
    if (const auto at = key.find("rad"); is_rad) key.replace(at, 3, "deg");
    flaws += fmt::format(", {}: {:.9g}", key, size / (is_rad ? degree : 1.0));
    flaw_sigmas += fmt::format(", {} {:.3g}", key, fit.flaw_sigma[flaw] / (is_rad ? degree : 1.0));
  }
  return fmt::format(
      "# {} per unit of command{}{}\n"
      "plant: {{kind: {}, gain: {:.9g}, unit: rad, tau_s: {:.9g}, command_delay_s: {:.9g}{}, "
      "sigma_gain: {:.3g}, sigma_tau_s: {:.3g}, sigma_command_delay_s: {:.3g}}}\n",
      is_angle ? "rad" : "rad/s",
      flaw_sigmas.empty() ? "" : "; sigma: ", flaw_sigmas.empty() ? "" : flaw_sigmas.substr(2),
      is_angle ? "angle" : "rate", fit.params[0], fit.params[1], fit.params[2], flaws, sigma[0], sigma[1], sigma[2]);
}

}  // namespace alidade
