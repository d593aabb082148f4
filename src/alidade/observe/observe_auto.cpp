#include <algorithm>
#include <sstream>

#include "alidade/observe/observe.h"

namespace alidade {
namespace {

constexpr double ask_beyond = 5.0;
constexpr int most_rounds = 6;

/// Frees what the cause names, "k1,k2", "mount". False: it cannot be estimated, or is already.
bool free_cause(const std::string& cause, bool lens_is_given, ObserveNuisances& estimate) {
  const ObserveNuisances before = estimate;
  std::istringstream names(cause);
  for (std::string name; std::getline(names, name, ',');) {
    const bool is_of_lens = name.size() == 2 && (name[0] == 'k' || name[0] == 'p');
    if (is_of_lens && lens_is_given) return false;
    if (name == "k1") estimate.k1 = true;
    if (name == "k2") estimate.k2 = true;
    if (name == "k3") estimate.k3 = true;
    if (name == "p1" || name == "p2") estimate.tangential = true;
    if (name == "mount") estimate.mount = true;
    if (name == "delay") estimate.delay = true;
    if (name == "lever") estimate.lever = true;
  }
  // Higher terms without the lower ones are no lens that is made.
  estimate.k2 = estimate.k2 || (estimate.k3 && !lens_is_given);
  estimate.k1 = estimate.k1 || (estimate.k2 && !lens_is_given);
  return CommonLayout(estimate).size > CommonLayout(before).size;
}

/// The cause that explains the residuals best, of those that are asked for; null: none is.
const CauseScore* best_cause(const ObserveReport& report) {
  const CauseScore* best = nullptr;
  for (const CauseScore& cause : report.causes) {
    if (cause.z >= ask_beyond && (best == nullptr || cause.gain > best->gain)) best = &cause;
  }
  return best;
}

bool is_answer(const ObserveReport& report) { return report.status == ObserveReport::Status::ok; }

/// Without an answer there may be one where the camera is mounted askew, late, and bends its picture.
ObserveReport second_chance(const RotationLog& log, ObserveConfig& config, const Progress& progress) {
  ObserveConfig freer = config;
  freer.estimate.mount = freer.estimate.delay = true;
  if (!config.lens_is_given) freer.estimate.k1 = true;
  ObserveReport report = observe_as_told(log, freer, progress);
  if (is_answer(report)) config = freer;
  return report;
}

/// What is not modelled, and errors that last, may look like zooms, and each rest between them be explained by itself.
/// Where all rows fit one camera nearly as well there was no zoom: theirs is the answer. Where they do not but are
/// steady, what they ask for counts.
void settle_zooms(const RotationLog& log, const ObserveConfig& config, const Progress& progress,
                  ObserveReport& report) {
  constexpr double nearly = 1.2;  // of the noise: a zoom that moves points by their σ raises it more
  const bool has_zoom = std::any_of(report.events.begin(), report.events.end(), [](const ObserveNote& note) {
    return note.event == ObserveEvent::zoom || note.event == ObserveEvent::restart;
  });
  const bool is_known = config.rotation == RotationKnowledge::known;
  if (!has_zoom || !is_known || !is_answer(report) || config.method != ObserveMethod::hybrid) return;
  ObserveConfig whole = config;
  whole.method = ObserveMethod::batch;
  ObserveReport all = observe_as_told(log, whole, progress);
  if (!is_answer(all)) return;
  if (all.sigma_px < nearly * report.sigma_px) {
    const IntrinsicsEstimate last = all.steps.back();
    all.steps = std::move(report.steps);
    all.steps.back() = last;
    all.events = std::move(report.events);
    all.nis_per_dof = report.nis_per_dof;
    report = std::move(all);
    return;
  }
  constexpr double far_off =
      3.0;  // the noise of one camera's rows beside a real zoom's: nothing is to be learnt from them
  if (all.sigma_px > far_off * report.sigma_px) return;
  const CauseScore* best = best_cause(all);
  if (best == nullptr || best->name == "focal length that drifts") return;
  const CauseScore* known = best_cause(report);
  if (known == nullptr || best->gain > known->gain) report.causes = std::move(all.causes);
}

}  // namespace

ObserveReport observe(const RotationLog& log, const ObserveConfig& told, const Progress& progress) {
  ObserveConfig config = told;
  ObserveReport report = observe_as_told(log, config, progress);
  settle_zooms(log, config, progress, report);
  const bool is_regression = config.method == ObserveMethod::flow || config.method == ObserveMethod::fang2011;
  if (config.estimate_auto && config.rotation == RotationKnowledge::known && !is_regression) {
    using Status = ObserveReport::Status;
    if (report.status == Status::no_convergence || report.status == Status::unsteady) {
      ObserveReport second = second_chance(log, config, progress);
      if (is_answer(second)) {
        report = std::move(second);
        settle_zooms(log, config, progress, report);
      }
    }
    for (int round = 0; round < most_rounds && is_answer(report); ++round) {
      const CauseScore* cause = best_cause(report);
      ObserveConfig next = config;
      if (cause == nullptr || !free_cause(cause->name, config.lens_is_given, next.estimate)) break;
      ObserveReport freer = observe_as_told(log, next, progress);
      if (!is_answer(freer)) break;
      report = std::move(freer);
      config = next;
      settle_zooms(log, config, progress, report);
    }
  }
  report.estimated = config.estimate;
  if (may_be_misread(report)) report.misread = misread_rotation(log, config, report, progress);
  return report;
}

}  // namespace alidade
