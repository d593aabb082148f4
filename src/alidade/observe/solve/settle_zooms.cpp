#include "alidade/observe/solve/settle_zooms.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "alidade/observe/checks/cause_search.h"
#include "alidade/observe/solve/freed_causes.h"

namespace alidade {
namespace {

/// Share of rejected pixels in rows that the filter accepted: rows that no camera explains are no evidence of zooms.
double rejected_share(const ObserveSolution& solution, const RotationLog& log,
                      const std::vector<IntrinsicsEstimate>& filtered) {
  const RotationBundle& bundle = solution.reference.bundle;
  std::vector<double> kept(bundle.frames.size(), 0.0);
  for (const BundleObservation& seen : bundle.observations) kept[static_cast<std::size_t>(seen.frame)] += 1.0;
  double all = 0.0, out = 0.0;
  for (std::size_t k = 0; k < kept.size(); ++k) {
    const auto row = std::ranges::lower_bound(log.rows, bundle.frames[k].t_s - 1e-9, {}, &RotationRow::t_s);
    const IntrinsicsEstimate& estimate = filtered[static_cast<std::size_t>(row - log.rows.begin())];
    if (!estimate.has_value || estimate.event == ObserveEvent::burst) continue;
    const auto num = static_cast<double>(std::ranges::count_if(row->px, is_seen));
    all += num;
    out += num - kept[k];
  }
  return out / std::max(1.0, all);
}

/// Whether estimating one of the causes that all rows indicate most strongly leaves no more noise than `noise_px`.
bool a_cause_explains(const RotationLog& log, const ObserveSetup& whole, ObserveSolution& all, double noise_px,
                      const Progress& progress) {
  constexpr double as_well = 1.05;
  constexpr std::size_t most = 4;
  std::vector<CauseScore> causes = all.causes;
  std::erase_if(causes, [&](const CauseScore& cause) { return cause.z < asked_beyond(all); });
  std::ranges::sort(causes, std::ranges::greater{}, &CauseScore::gain);
  for (std::size_t i = 0; i < std::min(most, causes.size()); ++i) {
    ObserveSetup freer = whole;
    if (!free_cause(causes[i].name, log, freer)) continue;
    const ObserveSolution freed = solve_as_given(log, freer, progress);
    if (!is_answer(freed) || !(freed.sigma_px < as_well * noise_px)) continue;
    all.causes = {causes[i]};  // far from the optimum, the order of the scores is unreliable
    return true;
  }
  return false;
}

/// A step of the mounting that explains the log as well as the zooms of the report do.
std::optional<MountingStep> step_instead(const RotationLog& log, const ObserveSetup& config,
                                         const ObserveSolution& report, const Progress& progress) {
  constexpr double as_well = 1.1, less = 0.9;  // than the zooms, and than neither of them
  return mounting_step(log, config, report, as_well * report.sigma_px, less, progress);
}

/// A bumped camera: each part of the log seems to be from another one. In a short log a constant cause may explain as
/// much as a step; then that cause is indicated instead. False: neither.
bool takes_step(const RotationLog& log, const ObserveSetup& config, const ObserveSetup& whole, const Progress& progress,
                ObserveSolution& all, ObserveSolution& report) {
  const auto step = step_instead(log, config, report, progress);
  if (!step) return false;
  if (a_cause_explains(log, whole, all, step->noise_px, progress)) {
    report.causes = std::move(all.causes);
    return true;
  }
  report = std::move(all);
  report.mounting_step = step;
  report.mounting_step->is_counted = true;
  return true;
}

/// Whether each frame has a common error and its pixels scatter about it by less than `noise_px`; a zoom adds scatter.
bool is_noise_of_rotation(const ObserveSolution& all, double noise_px) {
  return all.jitter.noise_rad() > 0.0 && all.jitter.within_frames * all.scale.scale < noise_px;
}

}  // namespace

bool has_zoom(const ObserveSolution& report) {
  return std::any_of(report.events.begin(), report.events.end(), [](const ObserveNote& note) {
    return note.event == ObserveEvent::zoom || note.event == ObserveEvent::restart;
  });
}

void settle_zooms(const RotationLog& log, const ObserveSetup& config, const Progress& progress,
                  ObserveSolution& report) {
  constexpr double nearly = 1.2;  // of the noise: a zoom that moves points by their σ raises it more
  constexpr double more = 0.05;  // of the pixels: rows of another focal length are rejected as a whole, adding no noise
  const bool is_known = config.rotation == RotationKnowledge::known;
  if (!has_zoom(report) || report.mounting_step || !is_known || !is_answer(report) ||
      config.method != ObserveMethod::hybrid)
    return;
  ObserveSetup whole = config;
  whole.method = ObserveMethod::batch;
  ObserveSolution all = solve_as_given(log, whole, progress);
  if (!is_answer(all)) {
    report.mounting_step = step_instead(log, config, report, progress);
    return;
  }
  const auto rejected = [&](const ObserveSolution& each) { return rejected_share(each, log, report.steps); };
  const bool rejects_rows = rejected(all) > rejected(report) + more;
  const bool fits = all.sigma_px < nearly * report.sigma_px || is_noise_of_rotation(all, nearly * report.sigma_px);
  if ((fits && !rejects_rows) || config.no_zoom) {
    const IntrinsicsEstimate last = all.steps.back();
    all.steps = std::move(report.steps);
    all.steps.back() = last;
    all.events = std::move(report.events);
    all.nis_per_dof = report.nis_per_dof;
    report = std::move(all);
    return;
  }
  if (takes_step(log, config, whole, progress, all, report)) return;
  constexpr double far_off = 3.0;  // noise of one camera over that with zooms: if the zooms are real, it is large
  if (rejects_rows || all.sigma_px > far_off * report.sigma_px) return;
  const CauseScore* best = best_cause(all);
  if (best == nullptr || best->name == "focal length that drifts") return;
  const CauseScore* known = best_cause(report);
  if (known == nullptr || best->gain > known->gain) report.causes = std::move(all.causes);
}

}  // namespace alidade
