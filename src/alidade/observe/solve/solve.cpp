#include <algorithm>

#include "alidade/observe/checks/cause_search.h"
#include "alidade/observe/checks/constant_spans.h"
#include "alidade/observe/solve/freed_causes.h"
#include "alidade/observe/solve/settle_zooms.h"

namespace alidade {
namespace {

constexpr int max_rounds = 6;

/// Without an answer, tries to estimate a rotated mounting, a delay and distortion as well.
ObserveSolution second_chance(const RotationLog& log, ObserveSetup& config, const Progress& progress) {
  ObserveSetup freer = config;
  freer.nuisances.mount = freer.nuisances.delay = true;
  if (!config.lens_is_given) freer.nuisances.k1 = true;
  ObserveSolution report = solve_as_given(log, freer, progress);
  if (is_answer(report)) config = freer;
  return report;
}

/// A focal length that changes faster than by temperature or focus creep is a zoom.
constexpr double fastest_drift_per_s = 0.003;

bool zooms(const CauseScore& cause) {
  return cause.name == "focal length that drifts" && std::abs(cause.members.front().value) > fastest_drift_per_s;
}

bool is_of_lens(const std::string& cause) {
  return cause.size() >= 2 && (cause[0] == 'k' || cause[0] == 'p') && cause[1] >= '1' && cause[1] <= '3';
}

/// Another cause that explains the residuals about as well as the one that is estimated.
struct Rival {
  std::string freed, name;
  double by_px = 0.0;  ///< Difference between the answers.
};

void note_rivals(const ObserveSolution& report, const CauseScore& best, std::vector<Rival>& rivals) {
  constexpr double about_as_well = 10.0;  // of twice the log-likelihood: odds of 1 : 150
  constexpr double elsewhere = 3.0;       // σ
  const auto& quantities = report.quantities;
  for (const CauseScore& cause : report.causes) {
    const bool is_kin = estimate_word_of(cause.name) == estimate_word_of(best.name) ||
                        (is_of_lens(cause.name) && is_of_lens(best.name));
    if (is_kin || cause.z < asked_beyond(report) || cause.gain < best.gain - about_as_well) continue;
    const double by_px = report.scale.scale * (cause.shift.head<2>() - best.shift.head<2>()).cwiseAbs().maxCoeff();
    if (!(by_px > elsewhere * std::max(quantities[0].sigma_model, quantities[1].sigma_model))) continue;
    rivals.push_back({best.name, cause.name, by_px});
  }
}

/// Checks for the rivals that are not estimated in the end.
std::vector<Check> rival_checks(const std::vector<Rival>& rivals, const RotationLog& log, const ObserveSetup& config) {
  std::vector<Check> checks;
  for (const Rival& rival : rivals) {
    ObserveSetup freer = config;
    if (!free_cause(rival.name, log, freer)) continue;
    checks.push_back({"separable", State::care,
                      rival.freed + " explains the residuals, and " + rival.name +
                          " would about as well: these pixels cannot distinguish them (fx, fy would differ by " +
                          text_of(rival.by_px, 2) + " px)",
                      rival.by_px, 0.0, "px", "residuals"});
  }
  return checks;
}

/// Estimates one more cause at a time, the one that explains most first.
void free_one_by_one(const RotationLog& log, const Progress& progress, ObserveSetup& config, ObserveSolution& report,
                     std::vector<Rival>& rivals) {
  for (int round = 0; round < max_rounds && is_answer(report); ++round) {
    const CauseScore* cause = best_cause(report, config.is_no_lever);
    ObserveSetup next = config;
    if (cause == nullptr || zooms(*cause) || !free_cause(cause->name, log, next)) break;
    ObserveSolution freer = solve_as_given(log, next, progress);
    if (!is_answer(freer)) break;
    if (cause->name == lever_cause && has_absurd_lever(freer)) {
      config.is_no_lever = true;
      continue;
    }
    note_rivals(report, *cause, rivals);
    report = std::move(freer);
    config = next;
    settle_zooms(log, config, progress, report);
  }
}

/// Residuals above the noise of points, or zooms, may be due to several causes at once.
bool is_doubtful(const ObserveSolution& report) {
  constexpr double max_ordinary_px = 2.0, many = 9.0, vague = 0.005;
  if (!is_answer(report)) return true;
  return has_zoom(report) || report.sigma_px > max_ordinary_px || report.stated.blocks.design_effect > many ||
         report.quantities[0].sigma > vague * report.quantities[0].value;
}

/// Tries sets of causes, starting from the given configuration.
bool search_causes(const RotationLog& log, const Progress& progress, ObserveSetup& config, ObserveSolution& report) {
  constexpr double clearly = 0.6, with_zoom = 3.0, max_px = 2.0;
  double max_px_here = max_px;
  if (is_answer(report)) max_px_here = std::min(max_px, (has_zoom(report) ? with_zoom : clearly) * report.sigma_px);
  const auto found = searched_causes(log, config, report, max_px_here, progress);
  if (!found) return false;
  ObserveSetup freer = *found;
  ObserveSolution again = solve_as_given(log, freer, progress);
  settle_zooms(log, freer, progress, again);
  if (!is_answer(again)) {
    freer.method = ObserveMethod::batch;
    again = solve_as_given(log, freer, progress);
    freer.method = config.method;
  }
  if (!is_answer(again)) return false;
  if (!config.nuisances.lever && !config.is_no_lever && has_absurd_lever(again)) {
    config.is_no_lever = true;
    return search_causes(log, progress, config, report);
  }
  report = std::move(again);
  config = std::move(freer);
  return true;
}

/// A zoom that never rests: it is indicated as a drift that is too fast, or σ is large and the focal length is not
/// constant in any second.
bool never_rests(const RotationLog& log, const ObserveSetup& config, const ObserveSolution& report,
                 const Progress& progress) {
  constexpr double vague = 0.005, max_ordinary_px = 2.0;
  if (report.status == ObserveSolution::Status::no_convergence) return has_no_rest(log, config, report, progress);
  if (!is_answer(report)) return false;
  const CauseScore* cause = best_cause(report);
  if (cause != nullptr && zooms(*cause)) return true;
  if (std::abs(report.reference.solution.camera.drift_per_s) > fastest_drift_per_s) return true;
  const bool is_vague =
      report.sigma_px > max_ordinary_px || report.quantities[0].sigma > vague * report.quantities[0].value;
  return is_vague && has_no_rest(log, config, report, progress);
}

/// The adjustment of all rows is the answer if the filter did not converge, or differs from it by more than its σ
/// explains; the report says so. Thus a filter is never worse.
void prefer_all_rows(const RotationLog& log, const ObserveSetup& config, const Progress& progress,
                     ObserveSolution& report) {
  constexpr double max_off = 3.0;
  using Status = ObserveSolution::Status;
  const bool is_filter = config.method == ObserveMethod::hybrid || config.method == ObserveMethod::window;
  if (!is_filter || config.rotation != RotationKnowledge::known) return;
  if (report.status == Status::focal_length_varies || report.status == Status::too_few_data) return;
  if (is_answer(report) && !(report.from_reference > max_off)) return;
  ObserveSetup whole = config;
  whole.method = ObserveMethod::batch;
  ObserveSolution all = solve_as_given(log, whole, progress);
  if (!is_answer(all)) return;
  const std::string why = is_answer(report)
                              ? "the filter ends " + text_of(report.from_reference, 2) + "σ from all rows together"
                              : std::string("the filter did not settle");
  all.events = std::move(report.events);
  all.side_checks.push_back({"from all rows", State::good, why + ": theirs is the answer", report.from_reference,
                             max_off, "σ", "intrinsics"});
  report = std::move(all);
}

/// Notes parameters that are estimated, but essentially from the typical sizes for instruments.
void note_ungiven(const ObserveSolution& report, const std::vector<RotationError>& errors,
                  std::vector<Check>& side_checks) {
  constexpr double hardly = 0.7;
  std::string names;
  for (const RotationError& error : errors) {
    for (const ObservedQuantity& quantity : report.quantities) {
      if (quantity.name != error.quantity || quantity.sigma_model < hardly * error.ordinary) continue;
      names += (names.empty() ? "" : ", ") + quantity.name;
    }
  }
  if (names.empty()) return;
  side_checks.push_back({"determined", State::good,
                         "the pixels hardly determine " + names + ": σ counts what such instruments ordinarily have",
                         0.0, 0.0, "", "residuals"});
}

/// A lever is indicated, but of a size that no head has: it is due to something else. Its contribution to σ stays.
void drop_lever(ObserveSolution& report) {
  std::erase_if(report.causes, [](const CauseScore& cause) { return cause.name.starts_with(lever_cause); });
  report.side_checks.push_back(
      {"no lever", State::good,
       "a lever would explain the residuals, but of 0.9 m or more: it is not estimated (--estimate lever does)", 0.0,
       0.0, "", "residuals"});
}

void note_assumed(ObserveSolution& report) {
  std::string names;
  for (const ObservedQuantity& quantity : report.quantities)
    if (is_assumed(report, quantity)) names += (names.empty() ? "" : ", ") + quantity.name;
  if (names.empty()) return;
  report.side_checks.push_back({"determined", State::good,
                                "the pixels do not determine " + names + ": value and σ are what was assumed", 0.0, 0.0,
                                "", "residuals"});
}

/// Residuals larger than the noise of any detector, or no answer: the rotation may be misread as well.
bool is_gross(const ObserveSolution& report) {
  constexpr double max_ordinary_px = 2.0;
  return may_be_misread(report) && (!is_answer(report) || report.sigma_px > max_ordinary_px);
}

/// Estimates what the residuals indicate: sets of causes if the answer is doubtful, else one cause after the other.
void find_causes(const RotationLog& log, const ObserveSetup& given, const Progress& progress, ObserveSetup& config,
                 ObserveSolution& report, std::vector<Rival>& rivals) {
  using Status = ObserveSolution::Status;
  if (is_doubtful(report) && report.status != Status::unobservable) search_causes(log, progress, config, report);
  if (report.status == Status::no_convergence || report.status == Status::focal_length_varies) {
    ObserveSolution second = second_chance(log, config, progress);
    if (is_answer(second)) {
      report = std::move(second);
      settle_zooms(log, config, progress, report);
    }
  }
  free_one_by_one(log, progress, config, report, rivals);
  ObserveSetup again = given;
  again.is_no_lever = config.is_no_lever;
  if (has_zoom(report) || !is_answer(report) || !is_doubtful(report)) return;
  if (!search_causes(log, progress, again, report)) return;
  config = std::move(again);
  rivals.clear();
  free_one_by_one(log, progress, config, report, rivals);
}

/// Residuals that nothing else explains, and that are not due to a zoom, may be due to a bump.
void seek_step(const RotationLog& log, const ObserveSetup& config, const Progress& progress, ObserveSolution& report) {
  constexpr double much_less = 0.6, max_ordinary_px = 2.0;
  if (report.mounting_step || !is_answer(report) || !is_doubtful(report) || has_zoom(report)) return;
  const CauseScore* best = best_cause(report);
  if (best != nullptr && best->name != step_cause) return;
  report.mounting_step = mounting_step(log, config, report, max_ordinary_px, much_less, progress);
  if (report.mounting_step) report.mounting_step->is_counted = true;
}

}  // namespace

ObserveSolution solve_intrinsics(const RotationLog& log, const ObserveSetup& given, const Progress& progress) {
  using Status = ObserveSolution::Status;
  ObserveSetup config = given;
  ObserveSolution report = solve_as_given(log, config, progress);
  settle_zooms(log, config, progress, report);
  std::vector<Rival> rivals;
  const bool is_regression = config.method == ObserveMethod::flow || config.method == ObserveMethod::fang2011;
  const bool is_known = config.rotation == RotationKnowledge::known;
  const bool is_judged = is_known && !is_regression && report.status != Status::too_few_data;
  // No cause explains a misread rotation: the time for searching one is saved.
  Misread misread;
  if (is_judged && is_gross(report)) misread = misread_rotation(log, config, report, progress);
  const bool is_noisy = config.rotation == RotationKnowledge::noisy && report.status != Status::too_few_data;
  if (config.estimate_auto && (is_noisy || (is_judged && !misread.explains_all && !report.mounting_step))) {
    find_causes(log, given, progress, config, report, rivals);
  } else if (config.estimate_auto && !is_known) {
    free_one_by_one(log, progress, config, report, rivals);
  }
  prefer_all_rows(log, config, progress, report);
  if (is_judged && !misread.explains_all) seek_step(log, config, progress, report);
  if (is_judged && !config.no_zoom && !misread.explains_all && !report.mounting_step &&
      never_rests(log, config, report, progress)) {
    report.status = Status::focal_length_varies;
  }
  if (is_answer(report)) {
    note_ungiven(report, estimated_errors(log, config), report.side_checks);
    for (Check& check : rival_checks(rivals, log, config)) report.side_checks.push_back(std::move(check));
  }
  report.estimated = config.nuisances;
  report.estimated_errors = config.estimate_errors;
  if (may_be_misread(report)) {
    report.misread = misread.is_sought ? misread.words : misread_rotation(log, config, report, progress).words;
  }
  if (!is_answer(report)) return report;
  if (is_noisy) count_left(best_cause(report), estimated_errors(log, config), report);
  compare_constant_spans(log, config, progress, report);
  if (config.is_no_lever) drop_lever(report);
  note_assumed(report);
  return report;
}

}  // namespace alidade
