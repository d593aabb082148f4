#include "alidade/results/head_outcome.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/formats/rig_file.h"
#include "alidade/geometry/degree.h"
#include "alidade/geometry/so3.h"
#include "alidade/results/documents/follow_document.h"
#include "alidade/results/observe_outcome.h"
#include "alidade/tables/servo_log_file.h"

namespace alidade {
namespace {

std::vector<double> numbers_of(const Eigen::Vector2d& both) { return {both[0], both[1]}; }

/// Of what a short log does not show the fit's σ is without end: such a value is omitted.
bool is_determined(const PositionerValue& value, std::size_t which) {
  constexpr std::array<double, num_positioner_values> max_sigma{100.0, 1e5, 100.0, 100.0,
                                                                6.3,   6.3, 6.3,   6.3};  // rad, s
  return std::isfinite(value.value) && std::isfinite(value.sigma) && value.sigma < max_sigma[which];
}

void fill_axis(const PositionerFit& fit, const std::string& name, ResultDocument& document) {
  JsonValue &estimate = document.estimate["axes"][name], &stddev = document.stddev["axes"][name];
  for (std::size_t i = 0; i < num_positioner_values; ++i) {
    const PositionerValue& value = *fit.values()[i];
    const bool is_bound = (&value == &fit.acceleration && !value.is_asked_for) || !is_determined(value, i);
    estimate[positioner_value_names[i]] = is_bound ? std::nan("") : value.value;
    stddev[positioner_value_names[i]] = is_bound ? std::nan("") : value.sigma;
    estimate["evidence"][positioner_value_names[i]] = value.evidence;
  }
  estimate["offset_rad"] = fit.offset_rad;
  stddev["offset_rad"] = fit.sigma_offset_rad;
  estimate["gain"] = fit.gain;
  stddev["gain"] = fit.sigma_gain;
  estimate["encoder_hz"] = fit.encoder_hz;
  estimate["rms_rad"] = fit.rms_rad;
  estimate["noise"] = fit.noise;
}

void append_axis_lines(const PositionerFit& fit, const std::string& name, std::vector<std::string>& lines) {
  const auto shown = [&fit](const PositionerValue& value, double unit, const char* word) {
    const auto values = fit.values();
    const std::size_t which =
        static_cast<std::size_t>(std::find(values.begin(), values.end(), &value) - values.begin());
    if (!is_determined(value, which)) return std::string("not shown by this log");
    if (&value == &fit.dead_band && !value.is_asked_for)  // the verdict's bound
      return fmt::format("below {:.2g} {}", std::sqrt(3.0) * value.sigma / unit, word);
    if (!value.is_asked_for && value.value <= 3.0 * value.sigma)
      return fmt::format("below {:.2g} {}", (value.value + 3.0 * value.sigma) / unit, word);
    return fmt::format("{:.5g} ± {:.2g} {}", value.value / unit, 3.0 * value.sigma / unit, word);
  };
  lines.push_back(name + "   (3σ)");
  lines.push_back("rate          " + shown(fit.rate, degree, "°/s"));
  lines.push_back("acceleration  " + (fit.acceleration.is_asked_for ? shown(fit.acceleration, degree, "°/s²")
                                                                    : std::string("larger than can be seen")));
  lines.push_back("time constant " + shown(fit.time_constant, 1e-3, "ms"));
  lines.push_back(
      "latency       " + shown(fit.latency, 1e-3, "ms") +
      (fit.encoder_hz > 0.0 ? fmt::format(", of an encoder that is read {:.3g} times a second", fit.encoder_hz) : ""));
  lines.push_back("backlash      " + shown(fit.backlash, degree, "°"));
  lines.push_back("dead band     " + shown(fit.dead_band, degree, "°"));
  lines.push_back(fmt::format("resolution    {:.3g}°", fit.resolution.value / degree));
  lines.push_back("repeatability " + shown(fit.repeatability, degree, "°"));
}

void fill_zoom(const ZoomTrial& zoom, JsonValue& estimate) {
  if (!zoom.has_zoom) return;
  estimate["zoom"]["from"] = zoom.from;
  estimate["zoom"]["to"] = zoom.to;
  estimate["zoom"]["read"] = zoom.read;
  estimate["zoom"]["moved_rad"] = numbers_of(zoom.moved_rad);
}

DataTable response_table(const PositionerFit& fit, const std::string& name) {
  std::vector<double> t, measured;
  for (std::size_t i = 0; i < fit.t_s.size(); ++i) {
    t.push_back(fit.t_s[i]);
    measured.push_back(fit.model_rad[i] - fit.residual_rad[i]);
  }
  return {name,
          {{"t_s", rounded(std::move(t), 5)},
           {"measured_rad", rounded(std::move(measured), 7)},
           {"model_rad", rounded(fit.model_rad, 7)},
           {"residual_rad", rounded(fit.residual_rad, 7)}}};
}

}  // namespace

JobOutcome outcome_of(const HeadIdentification& identified) {
  JobOutcome outcome;
  ResultDocument& document = outcome.document;
  document.command = "head";
  document.verdict = identified.verdict;
  document.counts.given = identified.logs[0].readings.size();
  document.estimate["url"] = identified.url;
  document.estimate["low_rad"] = numbers_of(identified.low_rad);
  document.estimate["high_rad"] = numbers_of(identified.high_rad);
  document.estimate["head_time_s"] = identified.head_time_s;
  for (std::size_t i = 0; i < 2; ++i) {
    const std::string name = head_axis_names[i];
    outcome.files.push_back({name + ".csv", servo_log_csv(servo_samples(identified.logs[i]))});
    if (identified.axes[i].status != PositionerFit::Status::ok) continue;
    fill_axis(identified.axes[i], name, document);
    append_axis_lines(identified.axes[i], name, outcome.lines);
    document.data.push_back(response_table(identified.axes[i], name));
  }
  document.counts.used = document.counts.given;
  fill_zoom(identified.zoom, document.estimate);
  return outcome;
}

JobOutcome outcome_of(const HeadSurvey& survey) {
  JobOutcome outcome;
  ResultDocument& document = outcome.document;
  document.command = "head";
  document.verdict = survey.verdict;
  document.counts.given = document.counts.used = survey.readings.size();
  JsonValue& estimate = document.estimate;
  estimate["url"] = survey.url;
  estimate["info"] = survey.limits.info;
  estimate["position_rad"] = numbers_of(survey.readings.back().pan_tilt_rad);
  if (survey.limits.are_given) {
    estimate["low_rad"] = numbers_of(survey.limits.low_rad);
    estimate["high_rad"] = numbers_of(survey.limits.high_rad);
  }
  if (survey.answers_questions) {
    estimate["latency_s"] = survey.latency_s;
    estimate["latency_p99_s"] = survey.latency_p99_s;
    document.stddev["latency_s"] = survey.jitter_s;
    estimate["jitter_s"] = survey.jitter_s;
  }
  if (survey.has_moved) {
    estimate["rate_rad_s"] = numbers_of(survey.rate_rad_s);
    estimate["resolution_rad"] = numbers_of(survey.resolution_rad);
    outcome.lines.push_back(fmt::format("a small move: pan {:.3g}°/s, tilt {:.3g}°/s; read in steps of {:.2g}°",
                                        survey.rate_rad_s[0] / degree, survey.rate_rad_s[1] / degree,
                                        survey.resolution_rad.maxCoeff() / degree));
  }
  DataTable table{"readings"};
  std::vector<double> t, wait, pan, tilt;
  for (const HeadPosition& reading : survey.readings) {
    t.push_back(reading.t_s - survey.readings.front().t_s);
    wait.push_back(reading.wait_s);
    pan.push_back(reading.pan_tilt_rad[0]);
    tilt.push_back(reading.pan_tilt_rad[1]);
  }
  table.columns = {{"t_s", t}, {"wait_s", wait}, {"pan_rad", pan}, {"tilt_rad", tilt}};
  document.data.push_back(std::move(table));
  fill_zoom(survey.zoom, estimate);
  return outcome;
}

namespace {

/// rig.yaml: the camera's mounting on the head; the delay stands beside it.
std::string rig_file_text(const HeadCalibration& calibration) {
  Eigen::Vector3d mount = Eigen::Vector3d::Zero();
  double delay_s = 0.0;
  for (const ObservedQuantity& each : calibration.report.quantities) {
    if (each.name == "mount_x_rad") mount[0] = each.value;
    if (each.name == "mount_y_rad") mount[1] = each.value;
    if (each.name == "mount_z_rad") mount[2] = each.value;
    if (each.name == "delay_s") delay_s = each.value;
  }
  Rig rig;
  rig.heads.resize(1);
  rig.heads[0].camera = calibration.report.camera;
  rig.heads[0].head.cam_from_tilt = exp_so3(mount);
  const std::vector<std::string> files{"camera.yaml"};
  return rig_text(rig, files) +
         fmt::format(
             "# delay_s: {:.6f}   (a frame shows the angles of so much later than its time; below zero: earlier)\n",
             delay_s);
}

std::string skipped_text(std::size_t skipped) {
  return skipped == 0 ? "" : fmt::format(" ({} skipped: newer ones had come)", skipped);
}

}  // namespace

JobOutcome outcome_of(const HeadCalibration& calibration) {
  JobOutcome outcome = outcome_of(calibration.report);
  ResultDocument& document = outcome.document;
  document.command = "head";
  document.verdict = calibration.verdict;
  std::erase_if(outcome.files, [](const NamedBytes& file) { return file.name != "camera.yaml"; });
  const bool has_camera = !outcome.files.empty();
  outcome.files.push_back({"log.csv", calibration.log_csv});
  if (has_camera) outcome.files.push_back({"rig.yaml", rig_file_text(calibration)});
  JsonValue& estimate = document.estimate;
  estimate["url"] = calibration.url;
  estimate["stream"] = calibration.stream;
  estimate["head_time_s"] = calibration.head_time_s;
  estimate["offline"] = calibration.offline;
  for (const ObservedQuantity& each : calibration.report.quantities)
    if (each.name == "delay_s")
      document.stddev["delay_s"] = std::hypot(each.sigma, calibration.sigma_clock_s, calibration.sigma_frame_s);
  constexpr std::array<const char*, 3> times{"arrival", "sender", "stamped"};
  estimate["frame_times"] = times[static_cast<std::size_t>(calibration.times)];
  estimate["frame_time_sigma_s"] = calibration.sigma_frame_s;
  estimate["time_stamp_jumps"] = calibration.num_jumps;
  estimate["frames"] = calibration.num_frames;
  estimate["frames_skipped"] = calibration.num_skipped;
  estimate["moves"] = calibration.num_moves;
  std::string words = "alidade";
  for (const std::string& word : calibration.offline) words += " " + word;
  outcome.lines.push_back(fmt::format("{} moves, {} frames{}, {:.0f} s; off line: {}", calibration.num_moves,
                                      calibration.num_frames, skipped_text(calibration.num_skipped),
                                      calibration.head_time_s, words));
  outcome.lines.push_back("delay_s: a frame shows the angles of so much later than its time; below zero: earlier");
  return outcome;
}

std::vector<NamedBytes> files_so_far(const HeadCalibration& calibration) {
  if (calibration.report.verdict.ok() && !calibration.report.quantities.empty()) return outcome_of(calibration).files;
  return {{"log.csv", calibration.log_csv}};
}

namespace {

void fill_forecast(const HeadFollowing& following, JsonValue& estimate) {
  estimate["period_s"] = following.period_s;
  estimate["image_age_s"] = following.image_age_s;
  if (!following.forecast) return;
  JsonValue& forecast = estimate["forecast"];
  forecast["rms_px"] = following.forecast->rms_px;
  forecast["controller"] = std::string(controller_name(following.forecast->controller));
  forecast["period_s"] = following.forecast->period_s;
  forecast["image_age_s"] = following.forecast->image_age_s;
  forecast["command_delay_s"] = following.forecast->command_delay_s;
}

}  // namespace

std::vector<NamedBytes> files_so_far(const HeadFollowing& following) {
  std::string csv =
      "t_s,pan_rad,tilt_rad,u_px,v_px,target_pan_rad,target_tilt_rad,error_px,asked_pan_rad,asked_tilt_rad\n";
  for (const FollowedFrame& frame : following.frames) {
    csv += fmt::format("{:.6f},{:.9f},{:.9f}", frame.t_s, frame.pan_tilt_rad[0], frame.pan_tilt_rad[1]);
    csv += frame.is_found ? fmt::format(",{:.4f},{:.4f},{:.9f},{:.9f},{:.4f}", frame.px[0], frame.px[1],
                                        frame.target_rad[0], frame.target_rad[1], frame.error_px.norm())
                          : std::string(",,,,,");
    csv += frame.asked_rad ? fmt::format(",{:.9f},{:.9f}\n", (*frame.asked_rad)[0], (*frame.asked_rad)[1])
                           : std::string(",,\n");
  }
  return {{"follow.csv", std::move(csv)}};
}

JobOutcome outcome_of(const HeadFollowing& following) {
  JobOutcome outcome;
  ResultDocument& document = outcome.document;
  document.command = "head";
  document.verdict = following.verdict;
  document.counts.given = following.frames.size();
  JsonValue& estimate = document.estimate;
  estimate["url"] = following.url;
  estimate["stream"] = following.stream;
  estimate["head_time_s"] = following.head_time_s;
  estimate["commands"] = following.num_commands;
  estimate["frames_skipped"] = following.num_skipped;
  const bool is_seen = following.max_px > 0.0;  // from a third of the time on
  estimate["rms_px"] = is_seen ? JsonValue(following.rms_px) : JsonValue();
  estimate["max_px"] = is_seen ? JsonValue(following.max_px) : JsonValue();
  estimate["central_third"] = is_seen ? JsonValue(following.central_third) : JsonValue();
  fill_forecast(following, estimate);
  document.data.push_back(follow_table(following.frames));
  document.counts.used = static_cast<std::size_t>(std::ranges::count_if(following.frames, &FollowedFrame::is_found));
  document.counts.dropped = document.counts.given - document.counts.used;
  outcome.files = files_so_far(following);
  outcome.lines.push_back(
      fmt::format("{} frames{}, {} commands{}", following.frames.size(), skipped_text(following.num_skipped),
                  following.num_commands,
                  is_seen ? fmt::format("; from a third of the time on {:.3g} px RMS", following.rms_px) : ""));
  if (following.forecast)
    outcome.lines.push_back(fmt::format("servo predicts {:.3g} px RMS for this head, these delays and this target",
                                        following.forecast->rms_px));
  return outcome;
}

}  // namespace alidade
