#include "alidade/heads/head_survey.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "alidade/geometry/degree.h"

namespace alidade {
namespace {

/// Answers' times, in order of size.
std::vector<double> sorted_waits(const std::vector<HeadPosition>& readings) {
  std::vector<double> waits;
  for (const HeadPosition& reading : readings) waits.push_back(reading.wait_s);
  std::ranges::sort(waits);
  return waits;
}

double change_seen(const std::vector<HeadPosition>& readings, int axis) {
  constexpr double same_rad = 1e-9;
  double least = 0.0;
  for (std::size_t i = 1; i < readings.size(); ++i) {
    const double apart = std::abs(readings[i].pan_tilt_rad[axis] - readings[i - 1].pan_tilt_rad[axis]);
    if (apart > same_rad && (least == 0.0 || apart < least)) least = apart;
  }
  return least;
}

/// Over a tenth of a second or more: single readings are too coarse and too ill timed.
double largest_rate(const std::vector<HeadPosition>& readings, int axis) {
  double largest = 0.0;
  for (std::size_t i = 0, j = 0; j < readings.size(); ++j) {
    while (i + 1 < j && readings[j].t_s - readings[i + 1].t_s >= 0.1) ++i;
    const double dt = readings[j].t_s - readings[i].t_s;
    if (dt < 0.1) continue;
    largest = std::max(largest, std::abs(readings[j].pan_tilt_rad[axis] - readings[i].pan_tilt_rad[axis]) / dt);
  }
  return largest;
}

/// A step inwards of both axes, and back.
void move_a_little(MovingHead& head, HeadSurvey& survey) {
  const Eigen::Vector2d start = head.position().pan_tilt_rad.cwiseMax(head.low_rad()).cwiseMin(head.high_rad());
  Eigen::Vector2d away;
  for (int axis = 0; axis < 2; ++axis) {
    const double room_up = head.high_rad()[axis] - start[axis], room_down = start[axis] - head.low_rad()[axis];
    const double step = std::min(3.0 * degree, 0.5 * std::max(room_up, room_down));
    away[axis] = start[axis] + (room_up >= room_down ? step : -step);
  }
  std::vector<HeadPosition> way;
  head.on_reading = [&](const HeadPosition& reading) { way.push_back(reading); };
  constexpr double max_s = 15.0;
  head.command(away);
  wait_for_rest(head, max_s);
  head.command(start);
  wait_for_rest(head, max_s);
  survey.zoom = try_zoom(head);
  head.stop();
  survey.has_moved = true;
  for (int axis = 0; axis < 2; ++axis) {
    survey.resolution_rad[axis] = change_seen(way, axis);
    survey.rate_rad_s[axis] = largest_rate(way, axis);
  }
}

Verdict verdict_of(const HeadSurvey& survey) {
  Verdict verdict;
  const Eigen::Vector2d low = survey.limits.low_rad / degree, high = survey.limits.high_rad / degree;
  const Eigen::Vector2d at = survey.readings.back().pan_tilt_rad / degree;
  const std::string answers = survey.answers_questions ? fmt::format("answers in {:.2g} ± {:.1g} ms",
                                                                     1e3 * survey.latency_s, 1e3 * survey.jitter_s)
                                                       : "reports its position unasked";
  verdict.sentence = fmt::format("{}, is at pan {:.2f}°, tilt {:.2f}°", answers, at[0], at[1]);
  if (survey.limits.are_given) {
    verdict.sentence += fmt::format("; pan {:g}…{:g}°, tilt {:g}…{:g}°", low[0], high[0], low[1], high[1]);
    verdict.checks.push_back({.name = "limits", .text = "the head names its limits"});
  } else if (!survey.limits.assumed.empty()) {
    verdict.sentence += fmt::format("; pan {:g}…{:g}°, tilt {:g}…{:g}° are supposed", low[0], high[0], low[1], high[1]);
  } else {
    verdict.state = State::care;
    verdict.to_add = "give --pan-range and --tilt-range before it moves";
    verdict.sentence += "; it names no limits";
    verdict.checks.push_back({.name = "limits", .state = State::care, .text = "the head names no limits"});
  }
  if (!survey.has_moved) return verdict;
  const bool still = survey.resolution_rad.minCoeff() == 0.0;
  verdict.checks.push_back(
      {.name = "moves",
       .state = still ? State::bad : State::good,
       .text = still ? "a command was taken, and the reading did not change" : "the readings follow the commands"});
  judge_zoom(survey.zoom, verdict);
  if (!still) return verdict;
  verdict.state = State::bad;
  verdict.exit_code = ExitCode::not_trusted;
  verdict.sentence +=
      "; a command was taken, and the reading did not change: positions are refused silently, or its reading is frozen";
  return verdict;
}

}  // namespace

ZoomTrial try_zoom(MovingHead& head) {
  constexpr double step = 0.1, max_s = 8.0;
  ZoomTrial trial;
  const std::optional<double> begin = head.device().zoom();
  if (!begin) return trial;
  trial.has_zoom = true;
  trial.from = *begin;
  trial.to = *begin > 0.5 ? *begin - step : *begin + step;
  const Eigen::Vector2d before = wait_for_rest(head, max_s).pan_tilt_rad;
  head.zoom_to(trial.to);
  trial.moved_rad = wait_for_rest(head, max_s).pan_tilt_rad - before;
  trial.read = head.device().zoom().value_or(std::nan(""));
  head.zoom_to(trial.from);
  (void)wait_for_rest(head, max_s);
  return trial;
}

void judge_zoom(const ZoomTrial& trial, Verdict& verdict) {
  constexpr double still_rad = 0.1 * degree, same = 0.02;
  if (!trial.has_zoom) return;
  const double moved = trial.moved_rad.cwiseAbs().maxCoeff();
  const bool moves = moved > still_rad, follows = std::abs(trial.read - trial.to) < same;
  Check check{.name = "zoom",
              .text = "zoom moves neither pan nor tilt",
              .value = moved / degree,
              .limit = still_rad / degree,
              .unit = "°"};
  if (moves) {
    check.state = State::bad;
    check.text =
        fmt::format("zoom moves {}: by {:.2f}° where zoom alone was commanded",
                    std::abs(trial.moved_rad[0]) >= std::abs(trial.moved_rad[1]) ? "pan" : "tilt", moved / degree);
  } else if (!follows) {
    check.state = State::care;
    check.text = fmt::format("zoom reads {:.3g} where {:.3g} was commanded", trial.read, trial.to);
  }
  verdict.checks.push_back(check);
  if (check.state == State::good) return;
  verdict.sentence += "; " + check.text;
  if (check.state == State::bad) verdict.exit_code = ExitCode::not_trusted;
  if (verdict.state == State::good || check.state == State::bad) verdict.state = check.state;
}

HeadPosition wait_for_rest(MovingHead& head, double max_s) {
  constexpr double rest_s = 0.5, min_s = 0.6;
  const double begin_s = head.now_s();
  HeadPosition last = head.position();
  double still_since_s = last.t_s;
  while (head.now_s() - begin_s < max_s) {
    const HeadPosition next = head.position();
    if (next.pan_tilt_rad != last.pan_tilt_rad) still_since_s = next.t_s;
    last = next;
    if (next.t_s - still_since_s >= rest_s && next.t_s - begin_s >= min_s) break;
  }
  return last;
}

HeadSurvey survey_head(HeadDevice& device, bool moves, const HeadRange& range, const Progress& progress) {
  constexpr std::size_t num_readings = 100;
  HeadSurvey survey{.url = device.name(), .limits = device.limits(), .readings = {}, .verdict = {}};
  survey.answers_questions = device.answers_questions();
  MovingHead head(device, range.low_rad, range.high_rad, progress);
  for (std::size_t i = 0; i < num_readings; ++i) {
    report_progress(progress, "readings", i, num_readings);
    survey.readings.push_back(head.position());
  }
  const std::vector<double> waits = sorted_waits(survey.readings);
  survey.latency_s = waits[num_readings / 2];
  survey.latency_p99_s = waits[num_readings - 2];
  double sum2 = 0.0;
  for (const double wait : waits) sum2 += (wait - survey.latency_s) * (wait - survey.latency_s);
  survey.jitter_s = std::sqrt(sum2 / (num_readings - 1));
  if (moves) move_a_little(head, survey);
  survey.verdict = verdict_of(survey);
  return survey;
}

}  // namespace alidade
