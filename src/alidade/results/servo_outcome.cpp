#include "alidade/results/servo_outcome.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <limits>
#include <span>

#include "alidade/report/thin.h"
#include "alidade/results/documents/track_document.h"
#include "alidade/results/thin_tables.h"

namespace alidade {
namespace {

using Numbers = std::vector<double>;

/// The columns of a row behind its time and head; of `control` and of servo.csv alike.
constexpr std::size_t num_columns = 18;
constexpr std::array<const char*, num_columns> columns{
    "asked_pan_rad",     "asked_tilt_rad",     "measured_pan_rad", "measured_tilt_rad",
    "predicted_pan_rad", "predicted_tilt_rad", "rate_pan_rad_s",   "rate_tilt_rad_s",
    "command_pan",       "command_tilt",       "error_u_px",       "error_v_px",
    "sigma_error_u_px",  "sigma_error_v_px",   "in_picture",       "fx_px",
    "sigma_fx_px",       "true_fx_px"};

std::array<double, num_columns> cells_of(const ServoRow& row) {
  const auto if_predicted = [&](double value) { return row.has_prediction ? value : missing_value; };
  return {row.asked_rad.x(),
          row.asked_rad.y(),
          row.measured_rad.x(),
          row.measured_rad.y(),
          if_predicted(row.predicted_rad.x()),
          if_predicted(row.predicted_rad.y()),
          row.rate_rad_s.x(),
          row.rate_rad_s.y(),
          row.command.x(),
          row.command.y(),
          row.error_px.x(),
          row.error_px.y(),
          if_predicted(row.sigma_predicted_px.x()),
          if_predicted(row.sigma_predicted_px.y()),
          row.is_in_image ? 1.0 : 0.0,
          row.lens.k[0],
          row.lens.sigma[0],
          row.true_lens[0]};
}

JsonValue figures_value(const ServoFigures& figures) {
  JsonValue value = JsonValue::object();
  value["rms_px"] = figures.rms_px;
  value["between_px"] = figures.between_px;
  value["p95_px"] = figures.p95_px;
  value["max_px"] = figures.max_px;
  value["central_third"] = figures.central_third;
  value["in_picture"] = figures.in_image;
  value["lost"] = figures.num_lost;
  value["found"] = figures.num_found;
  value["search_s"] = figures.search_s;
  value["unseen"] = figures.unseen;
  return value;
}

DataTable control_table(std::span<const RigHead> rig, std::span<const ServoRow> rows) {
  std::vector<bool> has_event;
  for (const ServoRow& row : rows)
    has_event.push_back(row.event != ServoEvent::none && row.event != ServoEvent::searching);
  Numbers t;
  std::vector<int> heads;
  std::vector<std::string> events;
  std::array<Numbers, num_columns> cells;
  for (const std::size_t at : report::thinned_rows(rows.size(), {}, has_event, report::max_step_rows)) {
    const ServoRow& row = rows[at];
    t.push_back(row.t_s);
    heads.push_back(rig[row.head].head.id);
    events.emplace_back(servo_event_name(row.event));
    const auto own = cells_of(row);
    for (std::size_t k = 0; k < num_columns; ++k) cells[k].push_back(own[k]);
  }
  DataTable table{"control", {{"t_s", rounded(std::move(t), 6)}, {"head", heads}}};
  for (std::size_t k = 0; k < num_columns; ++k)
    table.columns.emplace_back(columns[k], rounded(std::move(cells[k]), k < 8 ? 6 : 4));
  table.columns.emplace_back("event", events);
  record_steps_kept(table, rows.size(), "", "servo.csv");
  return table;
}

DataTable trials_table(const ServoStudy& study) {
  std::vector<std::string> names;
  std::vector<std::int64_t> seeds;
  Numbers rms, p95, most, central;
  for (const ServoTrial& trial : study.trials) {
    names.emplace_back(controller_name(trial.controller));
    seeds.push_back(static_cast<std::int64_t>(trial.seed));
    rms.push_back(trial.figures.rms_px);
    p95.push_back(trial.figures.p95_px);
    most.push_back(trial.figures.max_px);
    central.push_back(trial.figures.central_third);
  }
  return {"trials",
          {{"controller", names},
           {"seed", seeds},
           {"rms_px", rounded(std::move(rms), 4)},
           {"p95_px", rounded(std::move(p95), 4)},
           {"max_px", rounded(std::move(most), 4)},
           {"central_third", rounded(std::move(central), 4)}}};
}

/// What is known of a loop beside its radius; missing where the controller was tried, or there is none.
struct LoopNumbers {
  double gain = missing_value, bandwidth = missing_value, margin = missing_value, delay = missing_value;

  explicit LoopNumbers(const LoopCheck& loop) {
    if (loop.delay_samples < 0) return;
    gain = loop.loop_gain;
    delay = loop.delay_samples;
    if (loop.analysis.bandwidth_rad_s > 0.0) bandwidth = loop.analysis.bandwidth_rad_s;
    if (loop.analysis.crossover_rad_s > 0.0) margin = loop.analysis.phase_margin_deg;
  }
};

DataTable loops_table(const ServoStudy& study) {
  std::vector<std::string> names;
  Numbers gain, bandwidth, margin, delays, radius;
  for (const LoopCheck& loop : study.loops) {
    const LoopNumbers known(loop);
    names.emplace_back(controller_name(loop.controller));
    gain.push_back(known.gain);
    bandwidth.push_back(known.bandwidth);
    margin.push_back(known.margin);
    delays.push_back(known.delay);
    radius.push_back(loop.analysis.sampled_radius);
  }
  return {"loops",
          {{"controller", names},
           {"loop_gain", gain},
           {"bandwidth_rad_s", bandwidth},
           {"phase_margin_deg", margin},
           {"delay_samples", delays},
           {"sampled_radius", radius}}};
}

/// RMS by seed of each kind of knowledge of the lens.
DataTable lenses_table(const ServoStudy& study, std::uint64_t first_seed) {
  std::vector<std::string> names;
  std::vector<std::int64_t> seeds;
  Numbers rms, p95, most, share, z;
  for (const LensComparison& compared : study.lenses) {
    for (std::size_t i = 0; i < compared.trials.size(); ++i) {
      names.emplace_back(lens_knowledge_name(compared.knowledge));
      seeds.push_back(static_cast<std::int64_t>(first_seed + i));
      rms.push_back(compared.trials[i].rms_px);
      p95.push_back(compared.trials[i].p95_px);
      most.push_back(compared.trials[i].max_px);
      share.push_back(compared.trials[i].focal_share);
      z.push_back(compared.trials[i].focal_z);
    }
  }
  return {"lenses",
          {{"intrinsics", names},
           {"seed", seeds},
           {"rms_px", rounded(std::move(rms), 4)},
           {"p95_px", rounded(std::move(p95), 4)},
           {"max_px", rounded(std::move(most), 4)},
           {"focal_share", rounded(std::move(share), 6)},
           {"focal_z", rounded(std::move(z), 4)}}};
}

/// Rows gain by gain, columns time constant by time constant.
DataGrid robustness_grid(const ServoRobustness& robustness) {
  DataGrid grid;
  grid.name = "robustness";
  grid.rows = static_cast<int>(robustness.gain_factors.size());
  grid.cols = static_cast<int>(robustness.tau_factors.size());
  Numbers gains, taus;
  for (const double gain : robustness.gain_factors)
    for (const double tau : robustness.tau_factors) {
      gains.push_back(gain);
      taus.push_back(tau);
    }
  grid.values = {{"gain", gains}, {"tau", taus}, {"rms_px", rounded(robustness.rms_px, 4)}};
  return grid;
}

void fill_servo(const ServoScenario& scenario, const ServoStudy& study, ResultDocument& document) {
  JsonValue& estimate = document.estimate;
  estimate["controllers"] = JsonValue::object();
  for (const ServoComparison& compared : study.comparison)
    estimate["controllers"][controller_name(compared.controller)] = figures_value(compared.figures);
  estimate["loops"] = JsonValue::object();
  for (const LoopCheck& loop : study.loops) {
    JsonValue value = JsonValue::object();
    value["sampled_radius"] = loop.analysis.sampled_radius;
    const LoopNumbers known(loop);
    value["bandwidth_rad_s"] = known.bandwidth;
    value["phase_margin_deg"] = known.margin;
    value["loop_gain"] = known.gain;
    value["swing_px"] = loop.swing_px;
    value["radius_within_3_sigma"] = loop.radius_within_sigma > 0.0 ? loop.radius_within_sigma : missing_value;
    estimate["loops"][controller_name(loop.controller)] = value;
  }
  document.data.push_back(loops_table(study));
  if (study.comparison.empty()) return;
  estimate["best"] = std::string(controller_name(study.best));
  estimate["specification_px"] = scenario.specification_px;
  document.data.push_back(trials_table(study));
  for (const ServoComparison& compared : study.comparison)
    if (compared.controller == study.best)
      document.data.push_back(control_table(scenario.scene.heads, compared.shown.rows));
  if (!study.lenses.empty()) {
    estimate["intrinsics"] = JsonValue::object();
    for (const LensComparison& compared : study.lenses) {
      JsonValue value = figures_value(compared.figures);
      value["focal_share"] = compared.figures.focal_share;
      value["focal_z"] = compared.figures.focal_z;
      estimate["intrinsics"][lens_knowledge_name(compared.knowledge)] = value;
    }
    document.data.push_back(lenses_table(study, study.trials.front().seed));
  }
  const ServoTrack& track = study.track;
  if (!track.report.steps.empty())
    add_track_tables(track.observations, scenario.scene.heads, track.report, track.truth, document);
  if (study.robustness) document.grids.push_back(robustness_grid(*study.robustness));
}

/// Text of servo.csv: the first trial of every controller, a row per head and period.
std::string servo_csv(const ServoScenario& scenario, const ServoStudy& study) {
  std::string text = "controller,t_s,head";
  for (std::size_t k = 0; k < num_columns; ++k) text += fmt::format(",{}", columns[k]);
  text += ",event\n";
  for (const ServoComparison& compared : study.comparison) {
    for (const ServoRow& row : compared.shown.rows) {
      text += fmt::format("{},{:.6f},{}", controller_name(compared.controller), row.t_s,
                          scenario.scene.heads[row.head].head.id);
      for (const double cell : cells_of(row)) text += std::isfinite(cell) ? fmt::format(",{:.6g}", cell) : ",";
      text += fmt::format(",{}\n", servo_event_name(row.event));
    }
  }
  return text;
}

void append_controllers_lines(const ServoStudy& study, std::vector<std::string>& lines) {
  lines.push_back("controller    RMS px   95 % px   max px   central third   in image");
  for (const ServoComparison& compared : study.comparison) {
    const ServoFigures& figures = compared.figures;
    lines.push_back(fmt::format(
        "{:<12} {:7.2f} {:9.2f} {:8.2f} {:13.1f} % {:10.1f} %{}", controller_name(compared.controller), figures.rms_px,
        figures.p95_px, figures.max_px, 100.0 * figures.central_third, 100.0 * figures.in_image,
        figures.num_lost > 0 ? fmt::format("   lost {}, found {}, {:.1f} s of search", figures.num_lost,
                                           figures.num_found, figures.search_s)
                             : ""));
  }
}

/// The best controller by the intrinsics that its loop goes by.
void append_lenses_lines(const ServoStudy& study, std::vector<std::string>& lines) {
  if (study.lenses.empty()) return;
  lines.push_back(fmt::format("intrinsics    RMS px   95 % px   max px   in image   fx off by   ({})",
                              controller_name(study.best)));
  for (const LensComparison& compared : study.lenses) {
    const ServoFigures& figures = compared.figures;
    lines.push_back(fmt::format("{:<12} {:7.2f} {:9.2f} {:8.2f} {:10.1f} % {:9.2g} %",
                                lens_knowledge_name(compared.knowledge), figures.rms_px, figures.p95_px, figures.max_px,
                                100.0 * figures.in_image, 100.0 * figures.focal_share));
  }
}

}  // namespace

DataTable servo_row(std::span<const RigHead> heads, const ServoRow& row) { return control_table(heads, {&row, 1}); }

JobOutcome outcome_of(const ServoResult& result) {
  JobOutcome outcome;
  outcome.document.command = "servo";
  outcome.document.seed = result.seed;
  outcome.document.counts = result.counts;
  outcome.document.assumed = result.assumed;
  outcome.document.verdict = result.verdict;
  fill_servo(result.scenario, result, outcome.document);
  append_controllers_lines(result, outcome.lines);
  append_lenses_lines(result, outcome.lines);
  if (is_estimate(static_cast<int>(result.verdict.exit_code)))
    outcome.files.push_back({"servo.csv", servo_csv(result.scenario, result)});
  return outcome;
}

}  // namespace alidade
