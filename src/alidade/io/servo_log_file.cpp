#include "alidade/io/servo_log_file.h"

#include <fmt/format.h>

#include <cmath>

#include "alidade/geometry/degree.h"
#include "alidade/io/table_rows.h"
#include "alidade/io/thin_tables.h"
#include "alidade/report/thin.h"
#include "alidade/servo/identify_causes.h"

namespace alidade {
namespace {

using Numbers = std::vector<double>;

void fill_table(std::span<const ServoSample> log, const ServoIdentification& identified, ResultDocument& document) {
  Numbers t, command, measured, model, residual;
  for (const std::size_t at : report::thinned_rows(log.size(), {identified.residual_rad}, {}, report::most_step_rows)) {
    t.push_back(log[at].t_s);
    command.push_back(log[at].command);
    measured.push_back(log[at].angle_rad);
    residual.push_back(identified.residual_rad[at]);
    model.push_back(log[at].angle_rad + identified.residual_rad[at]);
  }
  document.data.push_back({"response",
                           {{"t_s", t},
                            {"command", command},
                            {"measured_rad", rounded(std::move(measured), 7)},
                            {"model_rad", rounded(std::move(model), 7)},
                            {"residual_rad", rounded(std::move(residual), 7)}}});
  record_steps_kept(document.data.back(), log.size(), "");
}

/// What was freed beside a lag, and the encoder's own step.
void fill_flaws(std::span<const ServoSample> log, const ServoFit& fit, ResultDocument& document) {
  for (const std::size_t flaw : fit.freed) {
    document.estimate[servo_flaw_names[flaw]] = fit.flaws.*servo_flaws[flaw];
    document.stddev[servo_flaw_names[flaw]] = fit.is_observable ? fit.flaw_sigma[flaw] : std::nan("");
  }
  document.estimate["encoder_step_rad"] = encoder_step_rad(log);
}

void fill_assumed(const ServoIdentification& identified, ResultDocument& document) {
  const double gain = identified.fit.params[0], sigma = std::sqrt(identified.fit.cov(0, 0));
  // By definition: angles are the encoder's own radians, times the log's own seconds.
  document.assumed = {{.name = "encoder_scale", .value = 1.0, .sigma = 0.0, .moved = "gain_rad"},
                      {.name = "clock_rate", .value = 1.0, .sigma = 0.0, .moved = "tau_s"}};
  for (const HiddenFlaw& hidden : identified.hidden)
    document.assumed.push_back({.name = servo_flaw_names[hidden.flaw],
                                .value = servo_flaws[hidden.flaw] == &ServoFlaws::max_rate_rad_s ? std::nan("") : 0.0,
                                .ordinary = hidden.size,
                                .moves = std::abs(hidden.gain_factor - 1.0) * std::abs(gain) / sigma,
                                .moved = "gain_rad",
                                .moved_by = (hidden.gain_factor - 1.0) * gain,
                                .remedy = "log steps of several sizes to both sides, or a chirp"});
}

}  // namespace

ServoLogFile read_servo_log(const std::filesystem::path& file, bool skip_bad) {
  const Csv csv = Csv::read(file);
  const bool is_deg = csv.has("angle_deg");
  if (is_deg && csv.has("angle_rad")) throw InputError(csv.name() + ": has both 'angle_rad' and 'angle_deg'");
  const std::string angle = is_deg ? "angle_deg" : "angle_rad";
  for (const std::string& name : {std::string("t_s"), std::string("command"), angle})
    if (!csv.has(name)) throw InputError(csv.name() + ": has no column '" + name + "'; needs t_s,command,angle_rad");
  ServoLogFile read;
  for_each_row(csv, skip_bad, read.skipped, [&](std::size_t row) {
    const ServoSample sample{csv.number(row, "t_s"), csv.number(row, "command"),
                             csv.number(row, angle) * (is_deg ? degree : 1.0)};
    if (!read.samples.empty() && !(sample.t_s > read.samples.back().t_s))
      throw InputError(csv.where(row, "t_s") + ": '" + csv.text(row, "t_s") + "' is not after the row before it");
    if (!(std::abs(sample.angle_rad) <= 1e4))
      throw InputError(csv.where(row, angle) + ": '" + csv.text(row, angle) + "' is no angle of a servo");
    read.samples.push_back(sample);
  });
  if (read.samples.empty()) throw InputError(file.string() + ": has no rows");
  return read;
}

std::string servo_log_csv(std::span<const ServoSample> samples) {
  std::string text = "t_s,command,angle_rad\n";
  for (const ServoSample& sample : samples)
    text += fmt::format("{:.6f},{:.9g},{:.9f}\n", sample.t_s, sample.command, sample.angle_rad);
  return text;
}

std::string servo_plant_text(const ServoFit& fit) {
  const ServoParams sigma = fit.cov.diagonal().cwiseSqrt();
  const bool is_angle = fit.kind == ServoKind::angle;
  std::string flaws, flaw_sigmas;
  for (const std::size_t flaw : fit.freed) {
    const double size = fit.flaws.*servo_flaws[flaw];
    const std::string name = servo_flaw_names[flaw];
    const bool is_rad = name.find("rad") != std::string::npos;
    std::string key = name;
    if (const auto at = key.find("rad"); is_rad) key.replace(at, 3, "deg");
    // A scenario has no limit of the acceleration of an angle plant.
    const bool is_known = !(is_angle && name == "max_acceleration_rad_s2");
    if (is_known) flaws += fmt::format(", {}: {:.9g}", key, size / (is_rad ? degree : 1.0));
    flaw_sigmas += fmt::format(", {} {:.3g}", key, fit.flaw_sigma[flaw] / (is_rad ? degree : 1.0));
  }
  return fmt::format(
      "# {} per unit of command; sigma: gain {:.3g}, tau {:.3g} s, delay {:.3g} s{}\n"
      "plant: {{kind: {}, gain: {:.9g}, unit: rad, tau_s: {:.9g}, command_delay_s: {:.9g}{}}}\n",
      is_angle ? "rad" : "rad/s", sigma[0], sigma[1], sigma[2], flaw_sigmas, is_angle ? "angle" : "rate", fit.params[0],
      fit.params[1], fit.params[2], flaws);
}

void fill_identification(std::span<const ServoSample> log, const ServoIdentification& identified,
                         ResultDocument& document) {
  document.counts.given += log.size();
  document.counts.used = log.size();
  if (identified.residual_rad.empty()) return;
  const ServoFit& fit = identified.fit;
  JsonValue &estimate = document.estimate, &stddev = document.stddev;
  estimate["kind"] = fit.kind == ServoKind::angle ? "angle" : "rate";
  const ServoParams sigma = fit.cov.diagonal().cwiseSqrt();
  const double unknown = std::nan("");
  const ServoParams model = fit.cov_model.diagonal().cwiseSqrt();
  const auto put = [&](const char* name, int param, double unit) {
    estimate[name] = fit.params[param] / unit;
    stddev[name] = fit.is_observable ? sigma[param] / unit : unknown;
    document.stddev_model[name] = fit.is_observable ? model[param] / unit : unknown;
  };
  put("gain_rad", 0, 1.0);
  put("gain_deg", 0, degree);
  put("tau_s", 1, 1.0);
  put("latency_s", 2, 1.0);
  put("zero_rad", 3, 1.0);
  put("start_rad", 4, 1.0);
  fill_flaws(log, fit, document);
  fill_assumed(identified, document);
  estimate["design_effect"] = identified.clusters.design_effect;
  estimate["correlated_rows"] = identified.correlated_rows;
  estimate["rms_rad"] = fit.rms_rad;
  estimate["rms_of_other_kind_rad"] = identified.other.rms_rad;
  estimate["lag_one_correlation"] = identified.lag_one_correlation;
  if (fit.is_observable) {
    document.covariance_names = {"gain_rad", "tau_s", "latency_s", "zero_rad", "start_rad"};
    for (int i = 0; i < num_servo_params; ++i)
      for (int j = i; j < num_servo_params; ++j) document.covariance_upper.push_back(fit.cov(i, j));
  }
  fill_table(log, identified, document);
}

}  // namespace alidade
