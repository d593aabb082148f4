#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "alidade/description/name_list.h"
#include "alidade/geometry/degree.h"
#include "alidade/rig/rig.h"

namespace alidade {
namespace {

using RigStatus = RigReport::Status;
constexpr double good_relative_rad = 0.2 * degree, good_relative_m = 0.0035;  // of a use in tracking
constexpr double refuse_relative_rad = 2.0 * degree, refuse_relative_m = 0.05;

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

Verdict rig_refusal(State state, ExitCode code, std::string sentence, std::string add) {
  return {.state = state, .exit_code = code, .sentence = std::move(sentence), .to_add = std::move(add), .checks = {}};
}

Verdict undetermined(std::string sentence, std::string add) {
  return rig_refusal(State::refused, ExitCode::undetermined, std::move(sentence), std::move(add));
}

/// A head that never rotated about one of its axes.
std::optional<Verdict> refusal_by_angles(const RigReport& report) {
  for (const HeadCover& cover : report.covers) {
    const Eigen::Vector2d span = cover.highest_rad - cover.lowest_rad;
    const bool pans = span.x() >= min_span_rad, tilts = span.y() >= min_span_rad;
    const std::string head = "head " + std::to_string(cover.id);
    if (cover.num_views < 3 || (pans && tilts)) continue;
    if (!pans && !tilts)
      return undetermined(head + " does not rotate: its axes cannot be determined",
                          "look at each board at several pans and tilts, ±20° or more of each");
    if (pans)
      return undetermined(head + ": pan only: its tilt axis cannot be determined",
                          "tilt the head as well, by ±15° or more");
    return undetermined(head + ": tilt only: its pan axis cannot be determined",
                        "pan the head as well, by ±20° or more");
  }
  return std::nullopt;
}

std::optional<Verdict> refusal_by_count(const RigReport& report) {
  if (report.covers.empty()) return undetermined("no view is of a head with a camera", "give --camera for each head");
  for (const HeadCover& cover : report.covers) {
    if (cover.num_views >= 3) continue;
    return undetermined("head " + std::to_string(cover.id) + " has " + std::to_string(cover.num_views) +
                            " usable views; three are the least",
                        "look at boards from more angles, each board at least twice");
  }
  return std::nullopt;
}

Verdict refusal_by_link(const RigReport& report) {
  for (const HeadCover& cover : report.covers) {
    if (cover.num_shared_boards > 0) continue;
    return undetermined("head " + std::to_string(cover.id) +
                            " shares no board with another head: where they stand to each other cannot be determined",
                        "let both heads see a board in the same position");
  }
  return undetermined("not all heads share boards with each other", "let all heads see a board in the same position");
}

/// Views that contradict each other, and each by itself says that a lens is not its file's.
std::optional<Verdict> refusal_by_lens(const RigReport& report, const std::string& sentence) {
  constexpr double plain = 10.0;  // a bent board looks a little like it
  if (!report.lens_of_views || !(report.lens_of_views->sigmas > plain)) return std::nullopt;
  const RigCause& cause = *report.lens_of_views;
  return rig_refusal(State::not_converged, ExitCode::no_convergence,
                     sentence + ": each by itself they indicate another " + cause.name + ", by " +
                         text_of(cause.size, 2) + " (" + text_of(cause.sigmas, 2) + "σ)",
                     "calibrate that lens again: its file is of another lens, or lacks its distortion");
}

Verdict refusal_by_status(const RigReport& report) {
  if (report.status != RigStatus::misread)
    if (const auto few = refusal_by_count(report)) return *few;
  switch (report.status) {
    case RigStatus::degrees:
      return rig_refusal(State::refused, ExitCode::undetermined,
                         "the angles are degrees: the boards rotate as if each radian were a degree",
                         "give pan_rad and tilt_rad in radians");
    case RigStatus::swapped:
      return rig_refusal(State::refused, ExitCode::undetermined,
                         "heads swapped: the views of each head fit the camera of the other",
                         "exchange the cameras, or the numbers in column 'head'");
    case RigStatus::mirrored:
      return rig_refusal(
          State::refused, ExitCode::undetermined,
          "head " + std::to_string(report.mirrored_head) +
              " sees its boards from behind: its images are mirrored, or corners are counted the other way",
          "give images as the camera takes them (no mirror, no flip), corners row by row, left to right");
    case RigStatus::misread:
      return rig_refusal(State::refused, ExitCode::undetermined, report.misreading, report.misreading_remedy);
    case RigStatus::not_linked:
      return refusal_by_link(report);
    default:
      break;
  }
  if (const auto angles = refusal_by_angles(report)) return *angles;
  if (report.status == RigStatus::degenerate) {
    if (auto of_lens = refusal_by_lens(report, "no rig explains these views")) return *of_lens;
    return undetermined("these cannot be separated: " + joined(report.unknown),
                        "look at each board from more pans and tilts");
  }
  if (auto of_lens = refusal_by_lens(report, "no rig explains these views")) return *of_lens;
  return rig_refusal(State::not_converged, ExitCode::no_convergence, "no rig explains these views",
                     "check that each view has its own angles (radians), head and board, and the camera files");
}

Check check_of(std::string name, State state, std::string text, double value, double limit, std::string unit) {
  return {std::move(name), state, std::move(text), value, limit, std::move(unit), ""};
}

/// How many more views like these bring both σ down to what is good: they fall as the root of the number.
std::string views_lacking(const RigReport& report) {
  const double times =
      std::max(report.sigma_relative_rad / good_relative_rad, report.sigma_relative_m / good_relative_m);
  constexpr double most_times = 3.0;  // nine times as many views: nobody takes these
  if (times > most_times) return "; more views alone do not suffice: boards nearer or larger, at more pans and tilts";
  const double lacking = std::ceil(static_cast<double>(report.views.size()) * (times * times - 1.0));
  return "; add about " + text_of(lacking, 6) + (lacking < 1.5 ? " view" : " views") +
         ": boards at other positions, seen from more pans and tilts";
}

void add_precision(const RigReport& report, Verdict& verdict) {
  const std::string what = report.rig.heads.size() > 1 ? "between the cameras" : "of the camera as it rotates";
  const auto add = [&](const char* name, double value, double good, double refuse, double unit, const char* symbol,
                       const char* space) {
    const State state = !(value < refuse) ? State::refused : value > good ? State::care : State::good;
    verdict.checks.push_back(check_of(name, state,
                                      "σ " + what + " is up to " + text_of(value / unit, 2) + space + symbol +
                                          (state == State::care ? views_lacking(report) : ""),
                                      value / unit, good / unit, symbol));
  };
  add("rotation", report.sigma_relative_rad, good_relative_rad, refuse_relative_rad, degree, "°", "");
  add("position", report.sigma_relative_m, good_relative_m, refuse_relative_m, 1e-3, "mm", " ");
}

/// A small range of an axis is enough where the views determine the rig beyond it, too: what counts is σ over 20° of
/// each axis, not how far each happened to move.
void add_spans(const RigReport& report, Verdict& verdict) {
  const bool is_known = report.sigma_span_rad < good_relative_rad && report.sigma_span_m < good_relative_m;
  for (const HeadCover& cover : report.covers) {
    for (int axis = 0; axis < 2; ++axis) {
      const double span = cover.highest_rad[axis] - cover.lowest_rad[axis];
      const std::string name = axis == 0 ? "pan" : "tilt";
      verdict.checks.push_back(check_of(
          name + " " + std::to_string(cover.id), span >= good_span_rad || is_known ? State::good : State::care,
          "head " + std::to_string(cover.id) + " covers " + text_of(cover.lowest_rad[axis] / degree, 2) + "° to " +
              text_of(cover.highest_rad[axis] / degree, 2) + "° of " + name +
              (span >= good_span_rad ? ""
               : is_known            ? "; over 20° the rig is known, too"
                          : "; " + name + " farther: over 20° σ is " + text_of(report.sigma_span_rad / degree, 2) +
                                "°, " + text_of(1e3 * report.sigma_span_m, 2) + " mm"),
          span / degree, good_span_rad / degree, "°"));
    }
  }
}

void add_boards(const RigReport& report, Verdict& verdict) {
  if (report.rig.heads.size() < 2) return;
  int least = report.covers.front().num_shared_boards;
  for (const HeadCover& cover : report.covers) least = std::min(least, cover.num_shared_boards);
  verdict.checks.push_back(check_of("shared boards", least >= 3 ? State::good : State::care,
                                    std::to_string(least) + (least == 1 ? " position" : " positions") +
                                        " of the board seen by more than one head" +
                                        (least >= 3 ? "" : "; put it in three positions or more"),
                                    least, 3.0, ""));
}

/// The rejected views by name, those together that would fit by the same change of their rows.
std::string rejected_views(const RigReport& report) {
  std::vector<std::pair<std::string, std::vector<std::string>>> groups;  // change, views
  for (const HeadViewFit& fit : report.views) {
    if (fit.used) continue;
    auto group = std::ranges::find_if(groups, [&](const auto& one) { return one.first == fit.misreading; });
    if (group == groups.end()) group = groups.insert(group, {fit.misreading, {}});
    group->second.push_back(fit.name);
  }
  std::string text;
  for (const auto& [change, views] : groups)
    text += (text.empty() ? "" : "; ") + name_list(views) + (change.empty() ? "" : " (" + change + ")");
  return text;
}

/// A change of their rows explains all views that were rejected, or nearly all.
bool are_misread(const RigReport& report) {
  int explained = 0, rejected = 0;
  for (const HeadViewFit& fit : report.views) {
    rejected += fit.used ? 0 : 1;
    explained += fit.misreading.empty() ? 0 : 1;
  }
  return explained > 0 && 5 * explained >= 4 * rejected;
}

void add_fit(const RigReport& report, Verdict& verdict) {
  std::string named = rejected_views(report);
  const auto outliers = std::ranges::count(report.views, false, &HeadViewFit::used);
  const auto lost =
      std::ranges::find_if(report.covers, [](const HeadCover& cover) { return 2 * cover.num_used < cover.num_views; });
  const bool is_lost = lost != report.covers.end();
  if (is_lost)
    named += "; these are " + std::to_string(lost->num_views - lost->num_used) + " of the " +
             std::to_string(lost->num_views) + " of head " + std::to_string(lost->id);
  const auto given = static_cast<double>(report.views.size());
  const bool are_many = is_lost || static_cast<double>(outliers) > 0.4 * given;
  const State state = outliers == 0 ? State::good : are_many ? State::refused : State::care;
  verdict.checks.push_back(check_of("outliers", state, outliers == 0 ? "all views agree" : "rejected: " + named,
                                    static_cast<double>(outliers), 0.4 * given, ""));
  if (report.dof < 1) return;
  const double ratio = report.chi2_per_dof(), most = 1.3 + 3.0 * std::sqrt(2.0 / report.dof);
  verdict.checks.push_back(check_of("fit", ratio < most ? State::good : State::care,
                                    "χ² per degree of freedom is " + text_of(ratio), ratio, most, ""));
}

/// Encoders that are worse than any encoder say that something else is wrong.
void add_encoder(const RigReport& report, const RigConfig& config, Verdict& verdict) {
  constexpr double good_rad = 0.5 * degree;
  const double sigma = report.sigma_encoder_rad;
  verdict.checks.push_back(check_of("encoder", sigma < good_rad ? State::good : State::care,
                                    "σ of a reading is " + text_of(sigma / degree, 2) + "°" +
                                        (report.sigma_encoder_is_estimated ? " (estimated from the residuals)"
                                         : config.sigma_encoder_rad        ? " (as given)"
                                                                    : " (assumed: too few views to estimate it)"),
                                    sigma / degree, good_rad / degree, "°"));
}

/// The cause that is named: the most significant.
const RigCause& first_cause(const RigReport& report) {
  const RigCause* first = &report.causes.front();
  for (const RigCause& cause : report.causes)
    if (first->sigmas < rig_cause_limit && cause.sigmas > first->sigmas) first = &cause;
  return *first;
}

std::string indicated_text(const RigCause& cause) {
  const std::string by = ", by " + text_of(cause.size, 2) + (cause.unit.empty() ? "" : " " + cause.unit) + " (" +
                         text_of(cause.sigmas, 2) + "σ)";
  if (cause.name.ends_with(focal_drift_name))
    return "the residuals indicate a " + cause.name + " from the first view to the last" + by +
           ": a lens that was refocused or zoomed; fix it, and take the views again";
  if (cause.name == board_stretch_name)
    return "the board's columns are " + text_of(1e2 * std::abs(cause.size), 2) +
           (cause.size > 0.0 ? " % farther" : " % less") + " apart than its rows (" + text_of(cause.sigmas, 2) +
           "σ): its print is stretched (or the pixels of all cameras are); print it without scaling";
  if (cause.name == board_bend_name)
    return "the board is not flat, by " + text_of(1e3 * cause.size, 2) + " mm (" + text_of(cause.sigmas, 2) +
           "σ): glue it to something flat, and take the views again";
  if (cause.is_drift())
    return "the residuals indicate a " + cause.name + " from the first view to the last" + by +
           ": a head that was moved (two show it against each other only), or a zero that creeps; take the views again";
  if (cause.is_of_boards())
    return "boards were moved between the views of one head and those of another, by about " +
           text_of(1e3 * cause.size, 2) + " mm (" + text_of(cause.sigmas, 2) +
           "σ): fasten the board, and take all heads' views of a position before the next";
  return "the residuals indicate another " + cause.name + by;
}

/// Causes indicated by the residuals, beyond those that errors shared within views would give by chance.
void add_causes(const RigReport& report, Verdict& verdict) {
  if (report.causes.empty()) return;
  constexpr double most = rig_cause_limit;
  const RigCause& first = first_cause(report);
  const bool is_quiet = first.sigmas < most;
  verdict.checks.push_back(check_of(
      "causes", is_quiet ? State::good : State::care,
      is_quiet ? "other lenses, scales, eccentricities, backlash, drifts, moved and bent boards are not indicated"
               : indicated_text(first),
      first.sigmas, most, "σ"));
}

/// What was estimated by need is reported. Where it is significant the answer is one of care: it was not expected, and
/// an error of a shape that is not estimated would be mistaken for it.
void add_freed(const RigReport& report, Verdict& verdict) {
  constexpr double plain = 3.7;  // of forty that may be estimated, one clean rig in a hundred is above
  std::string text;
  const RigFreed* worst = nullptr;
  double most = plain;
  for (const RigFreed& one : report.freed) {
    text += (text.empty() ? "estimated too (3σ): " : ", ") + one.name + " " + text_of(one.value, 5) + " ± " +
            text_of(3.0 * one.sigma, 2);
    const double z = one.sigmas();
    if (z > most) most = z, worst = &one;
  }
  if (!report.alike.empty()) text += (text.empty() ? "" : "; ") + report.alike + " explain the residuals alike";
  if (text.empty()) return;
  const bool is_quiet = worst == nullptr && report.alike.empty();
  if (worst != nullptr)
    text = worst->name + " is " + text_of(worst->value, 5) + ", not " + text_of(worst->was, 5) + " (" +
           text_of(most, 2) + "σ): " +
           (worst->name.find("camera") != std::string::npos ? lens_remedy
                                                            : "check the encoder, and the rig at other angles") +
           "; " + text;
  verdict.checks.push_back(
      check_of("estimated", is_quiet ? State::good : State::care, text, worst != nullptr ? most : 0.0, plain, "σ"));
}

void add_views(const RigReport& report, Verdict& verdict) {
  verdict.checks.push_back(clusters_agree(report.clusters, "view",
                                          "blur, an encoder's jitter, the board's shape, or the lens", "residuals"));
}

/// The check of care that is named first: more views of the same do not remove a cause, or rows to be corrected; these
/// come before what views lack.
const Check* first_of_care(const RigReport& report, const Verdict& verdict) {
  const Check* care = nullptr;
  for (const Check& check : verdict.checks)
    if (check.state == State::care && care == nullptr) care = &check;
  for (const std::string_view cause : {"outliers", "estimated", "causes"}) {
    const auto named = std::ranges::find(verdict.checks, cause, &Check::name);
    if (cause == "outliers" && !are_misread(report)) continue;
    if (named != verdict.checks.end() && named->state == State::care) care = &*named;
  }
  return care;
}

Verdict refusal_by_check(const RigReport& report, const Check& refused, const Verdict& verdict) {
  const auto causes = std::ranges::find(verdict.checks, "causes", &Check::name);
  const bool is_of_lens =
      causes != verdict.checks.end() && causes->state == State::care && first_cause(report).is_of_lens();
  if (is_of_lens && refused.name != "outliers")
    return undetermined(refused.text + ": " + causes->text, "calibrate that lens again");
  if (refused.name != "outliers")
    return undetermined("too little for this noise: " + refused.text,
                        "look at more boards, nearer, from more pans and tilts");
  if (!are_misread(report))
    if (auto of_lens = refusal_by_lens(report, "the views do not agree")) return *of_lens;
  return rig_refusal(State::not_converged, ExitCode::no_convergence, "the views do not agree: " + refused.text,
                     are_misread(report) ? "correct these rows, and calibrate again"
                                         : "check that each view has its own angles, head and board");
}

}  // namespace

Verdict rig_verdict(const RigReport& report, const RigConfig& config) {
  if (report.status != RigStatus::converged) return refusal_by_status(report);
  if (const auto angles = refusal_by_angles(report)) return *angles;
  Verdict verdict;
  add_precision(report, verdict);
  add_spans(report, verdict);
  add_boards(report, verdict);
  add_fit(report, verdict);
  add_encoder(report, config, verdict);
  add_views(report, verdict);
  add_causes(report, verdict);
  add_freed(report, verdict);
  if (const auto refused = std::ranges::find(verdict.checks, State::refused, &Check::state);
      refused != verdict.checks.end()) {
    Verdict refusal = refusal_by_check(report, *refused, verdict);
    refusal.checks = std::move(verdict.checks);
    return refusal;
  }
  if (const Check* const care = first_of_care(report, verdict)) {
    verdict.state = State::care;
    verdict.to_add = care->text + (care->name == "outliers" && are_misread(report) ? "; correct these rows" : "");
  }
  const auto num = report.rig.heads.size();
  verdict.sentence = std::to_string(num) + (num == 1 ? " head" : " heads") + " from " +
                     std::to_string(report.views_used) +
                     (num == 1 ? " views, camera after a rotation ± " : " views, camera to camera ± ") +
                     text_of(3.0 * report.sigma_relative_rad / degree, 2) + "°, ± " +
                     text_of(3e3 * report.sigma_relative_m, 2) + " mm (3σ)";
  heed_assumptions(report.assumed, verdict);
  return verdict;
}

}  // namespace alidade
