#include "alidade/results/identify_document.h"

#include <cmath>

#include "alidade/geometry/degree.h"
#include "alidade/report/thin.h"
#include "alidade/results/thin_tables.h"
#include "alidade/servo/identify_causes.h"

namespace alidade {
namespace {

using Numbers = std::vector<double>;

void fill_table(std::span<const ServoSample> log, const ServoIdentification& identified, ResultDocument& document) {
  Numbers t, command, measured, model, residual;
  for (const std::size_t at : report::thinned_rows(log.size(), {identified.residual_rad}, {}, report::max_step_rows)) {
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
