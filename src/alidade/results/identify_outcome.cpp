#include "alidade/results/identify_outcome.h"

#include <fmt/format.h>

#include <cmath>
#include <span>

#include "alidade/geometry/degree.h"
#include "alidade/tables/servo_log_file.h"

namespace alidade {
namespace {

using Numbers = std::vector<double>;

void fill_response(const Identification& identified, ResultDocument& document) {
  const std::vector<ServoSample>& log = identified.log;
  Numbers t, command, measured, model, residual;
  for (std::size_t at = 0; at < log.size(); ++at) {
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
}

/// What was freed beside a lag, and the encoder's own step.
void fill_flaws(const Identification& identified, ResultDocument& document) {
  const ServoFit& fit = identified.fit;
  for (const std::size_t flaw : fit.freed) {
    document.estimate[servo_flaw_names[flaw]] = fit.flaws.*servo_flaws[flaw];
    document.stddev[servo_flaw_names[flaw]] = fit.is_observable ? fit.flaw_sigma[flaw] : std::nan("");
    document.estimate["evidence"][servo_flaw_names[flaw]] = fit.flaw_evidence[flaw];
  }
  document.estimate["encoder_step_rad"] = identified.encoder_step_rad;
  document.estimate["encoder_hz"] = identified.encoder_hz;
  document.estimate["sigma_time_s"] = identified.sigma_time_s;
}

void fill_identification(const Identification& identified, ResultDocument& document) {
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
  fill_flaws(identified, document);
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
  fill_response(identified, document);
}

void append_plant_lines(const ServoIdentification& identified, std::vector<std::string>& lines) {
  const ServoFit& fit = identified.fit;
  const ServoParams sigma = fit.cov.diagonal().cwiseSqrt();
  const bool is_angle = fit.kind == ServoKind::angle;
  constexpr double deg = 1.0 / degree;
  const std::string per = is_angle ? "" : "/s";
  lines.push_back(fmt::format("{} plant   (3σ)", is_angle ? "angle" : "rate"));
  lines.push_back(fmt::format("gain      {:.6g} ± {:.2g} rad{} per unit = {:.6g} ± {:.2g} deg{}", fit.params[0],
                              3.0 * sigma[0], per, fit.params[0] * deg, 3.0 * sigma[0] * deg, per));
  lines.push_back(fmt::format("tau       {:.6g} ± {:.2g} s", fit.params[1], 3.0 * sigma[1]));
  lines.push_back(fmt::format("latency   {:.6g} ± {:.2g} s", fit.params[2], 3.0 * sigma[2]));
  for (const std::size_t flaw : fit.freed)
    lines.push_back(fmt::format("{} {:.6g} ± {:.2g} {}", servo_flaw_words[flaw], fit.flaws.*servo_flaws[flaw],
                                3.0 * fit.flaw_sigma[flaw], servo_flaw_units[flaw]));
  if (identified.encoder_hz > 0.0)
    lines.push_back(fmt::format("encoder   sampled {:.4g} times a second", identified.encoder_hz));
  lines.push_back(fmt::format("residuals {:.3g}° RMS, correlation {:.2f}; as {} plant {:.3g}°", fit.rms_rad * deg,
                              identified.lag_one_correlation, is_angle ? "a rate" : "an angle",
                              identified.other.rms_rad * deg));
}

}  // namespace

JobOutcome outcome_of(const Identification& identification) {
  JobOutcome outcome;
  outcome.document.command = "identify";
  outcome.document.counts = identification.counts;
  outcome.document.assumed = identification.assumed;
  outcome.document.verdict = identification.verdict;
  fill_identification(identification, outcome.document);
  if (!is_estimate(static_cast<int>(identification.verdict.exit_code))) return outcome;
  append_plant_lines(identification, outcome.lines);
  outcome.files.push_back({"servo.yaml", servo_plant_text(identification.fit)});
  return outcome;
}

}  // namespace alidade
