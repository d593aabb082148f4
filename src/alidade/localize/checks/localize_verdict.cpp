#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "alidade/localize/checks/judge.h"
#include "alidade/localize/checks/missing_frames.h"
#include "alidade/localize/path/path_doubt.h"

namespace alidade {
namespace {

constexpr double good_nis_low = 0.4, good_nis_high = 1.5, care_nis = 2.0, max_nis = 4.0;
constexpr double bad_gated = 0.5, max_known_gated = 0.8, max_gated = 0.6, care_lost = 1.0 / 3.0, max_lost = 0.5;

double lost_share(const Localization& report) { return share(report.num_lost, report.path.size()); }
double gated_share(const Localization& report) { return share(report.num_gated, report.num_used + report.num_gated); }

Verdict stopped(State state, ExitCode code, std::string sentence, std::string to_add) {
  return {state, code, std::move(sentence), std::move(to_add), {}};
}

/// Reason why there is no path at all.
Verdict never_started(const Localization& report) {
  const auto undetermined = [](std::string sentence, std::string to_add) {
    return stopped(State::refused, ExitCode::undetermined, std::move(sentence), std::move(to_add));
  };
  if (report.num_alike > 1)
    return undetermined(std::to_string(report.num_alike) +
                            " things in one image look like the target: which one it is cannot be determined",
                        "begin where one of them is seen, or give --start");
  if (report.is_in_map)
    return undetermined("the map is not found in any of " + std::to_string(report.path.size()) + " frames",
                        "begin where the map was made, in view of what it holds, with the same camera");
  if (report.is_of_images && report.has_target)
    return undetermined("the target is not found in any of " + std::to_string(report.path.size()) + " images",
                        "begin in front of the target, whole and sharp, and check its size in --target");
  if (report.max_seen < 3)
    return undetermined(
        "too few points: at most " + std::to_string(report.max_seen) + " in a frame, a pose needs three",
        report.is_of_images ? "look at something with corners, in light" : "track more points");
  return undetermined("the target is not found: four of its points, not on a line, are never seen where they belong",
                      "begin in front of the target, or give --start");
}

/// Errors that only ground truth reveals: a path may fit its own map well and be wrong. An alignment only reduces
/// errors, so the rest should be within σ; without it, the truth may be in another frame.
void add_truth(const Localization& report, Verdict& verdict) {
  const PathError& error = report.error;
  if (!std::isfinite(error.ate_m) || !(error.stated_m > 0.0)) return;
  constexpr double care_ratio = 1.5, bad_ratio = 3.0, elsewhere_ratio = 3.0;
  const double ratio = error.ate_m / error.stated_m;
  verdict.checks.push_back(
      {"truth", state_of(ratio, care_ratio, bad_ratio),
       "the path is " + text_of(ratio, 2) + " times its σ from the truth, after the best alignment", ratio, care_ratio,
       "σ", "path"});
  if (!report.has_target) return;  // the frame is that of the first camera, not that of the truth
  const double before = error.unaligned_m / error.stated_m;
  if (report.scale_known && before > elsewhere_ratio)
    verdict.checks.push_back({"truth's frame", State::care,
                              "before alignment it is " + text_of(before, 2) +
                                  " times its σ away: the truth is in another frame, or the map is not where its "
                                  "σ says",
                              before, elsewhere_ratio, "σ", "path"});
}

/// Whether the filter was reinitialised repeatedly without being lost.
bool begins_often(const Localization& report) {
  std::size_t num_again = 0;
  for (std::size_t i = 1; i < report.path.size(); ++i)
    num_again += report.path[i].event == FrameEvent::restarted && report.path[i - 1].event != FrameEvent::predicted;
  constexpr std::size_t few = 3;
  constexpr double often = 0.01;
  return num_again >= few && share(num_again, report.path.size()) >= often;
}

/// Whether the smoothed path also explains the observations before a restart of the filter. Matches of images were
/// searched for where the filter predicted them: their fit shows that it was right only if the same points are seen on
/// both sides.
bool is_solved_again(const Localization& report) {
  constexpr double few = 0.01;
  if (!report.is_smoothed || !(share(report.num_unexplained, report.path.size()) < few)) return false;
  return !report.is_of_images || (report.num_untied == 0 && !begins_often(report));
}

/// Bad if restarts are frequent: no path explains what this camera saw of this target.
State restarts_state(const Localization& report) {
  if (is_solved_again(report)) return State::good;
  // Mismatches in a table may look like another pose for one frame.
  if (!report.is_of_images && (report.is_smoothed || !(report.nis_per_dof > good_nis_high))) return State::care;
  return begins_often(report) ? State::bad : State::care;
}

/// A restart after frames without a pose is a recovery; otherwise the path was wrong for some time before it.
std::string restarts_text(const Localization& report) {
  std::size_t num_back = 0, num_again = 0;
  long last_again = 0;
  for (std::size_t i = 1; i < report.path.size(); ++i) {
    if (report.path[i].event != FrameEvent::restarted) continue;
    const bool was_lost = report.path[i - 1].event == FrameEvent::predicted;
    ++(was_lost ? num_back : num_again);
    if (!was_lost) last_again = report.path[i].frame;
  }
  const auto times = [](std::size_t num) { return num == 1 ? std::string("once") : std::to_string(num) + " times"; };
  std::string text = num_back > 0 ? "found its way back " + times(num_back) : "";
  if (num_again > 0 && is_solved_again(report))
    text += (text.empty() ? "reinitialised " : "; reinitialised ") + times(num_again) +
            "; the path before it is solved again, from the map after it";
  else if (num_again > 0)
    text += (text.empty() ? "reinitialised " : "; reinitialised ") + times(num_again) +
            (num_again == 1 ? ", in" : ", last in") + " frame " + std::to_string(last_again) +
            ": do not trust the path before it" +
            (restarts_state(report) == State::bad ? "; camera or target are not as given" : "");
  return text;
}

/// Reports only the given number with the largest score over its limit: a wrong lens changes the other scores, too.
/// From one place, tilt and another shape of the target look alike, nonlinearly: the shape is not tested.
void add_given(const Localization& report, Verdict& verdict) {
  const GivenNumber* worst = nullptr;
  for (const GivenNumber& given : report.given) {
    if (report.is_from_one_place && given.name == "shape of the target") continue;
    if (worst == nullptr || doubt_of(given, report) > doubt_of(*worst, report)) worst = &given;
  }
  constexpr double bad_z = 15.0, min_move = 0.5;
  if (worst != nullptr && doubt_of(*worst, report) > 1.0 && moved_sigmas(*worst, report) > min_move) {
    const double z = supported_z(*worst, report.camera), care_z = z / doubt_of(*worst, report);
    verdict.checks.push_back(
        {"camera", z > bad_z ? State::bad : State::care, cause_text(*worst, report), z, care_z, "σ", "path"});
  }
  if (report.given_camera) {
    constexpr double much = 0.2;
    const double gated = gated_share(report);
    const bool is_no_cause = !report.is_of_images && (gated > much || report.nis_per_dof > good_nis_high);
    verdict.checks.push_back(
        {"camera", is_no_cause ? State::bad : State::care,
         "the lens is not as given: it is estimated with the path, " + lens_changes(report) +
             (is_no_cause ? ", and does not explain the observations: something else is not as given"
                          : "; camera.yaml has it"),
         gated, much, "1", "path"});
  }
  constexpr double care_pull = 3.0;
  if (report.lens_pull > care_pull)
    verdict.checks.push_back({"camera", State::care,
                              "the lens came out " + text_of(report.lens_pull, 2) +
                                  "σ from what was given: the camera file is not of this lens as it was used",
                              report.lens_pull, care_pull, "σ", "path"});
}

/// Residuals by a wrong lens after the update: the same along the radius in every frame. Unknown depths cause them as
/// well while the camera moves along its axis: tested only if known points are seen.
void add_radial(const Localization& report, Verdict& verdict) {
  constexpr double chance = 12.0;  // mean of squares of the rings' means over their σ²
  constexpr double care_share = 0.12, bad_share = 0.4;
  constexpr double min_px = 0.05;  // the changing appearance of patches causes less
  const RadialStructure& radial = report.radial;
  const bool is_more = report.has_target && report.scale_known && radial.chi2_per_ring > chance &&
                       radial.share * report.sigma_px > min_px;
  const double value = is_more ? radial.share : 0.0;
  const State state = state_of(value, care_share, bad_share);
  verdict.checks.push_back({"radial structure", state,
                            state == State::good ? "residuals along the radius are as noise leaves them"
                                                 : "residuals depend on the distance from the centre of the image, " +
                                                       text_of(radial.worst_px, 2) +
                                                       " px at worst: the lens is not as "
                                                       "given",
                            radial.share, care_share, "σ", "nis"});
}

/// Residuals should be independent: of the position in the image, and from frame to frame.
void add_residuals(const Localization& report, Verdict& verdict) {
  if (!report.is_smoothed) return;
  const ResidualStructure& residuals = report.residuals;
  constexpr double care_px_share = 0.2;  // of σ: smaller ones are significant in long recordings, but harmless
  if (residuals.mean_chi2 > 2.0 * residuals.mean_chi2_limit && residuals.worst_px > care_px_share * report.sigma_px)
    verdict.checks.push_back({"position in the image", State::care,
                              "residuals depend on the position in the image, " + text_of(residuals.worst_px, 2) +
                                  " px in the " + residuals.worst_region + ": the lens is not as given",
                              residuals.mean_chi2, 2.0 * residuals.mean_chi2_limit, "1", "nis"});
  if (residuals.is_autocorrelated())
    verdict.checks.push_back({"colour", State::care,
                              "errors last from frame to frame (correlation " + text_of(residuals.autocorrelation, 2) +
                                  "): the path is solved with that",
                              residuals.autocorrelation, 0.25, "1", "nis"});
}

/// A filter over hundreds of frames is overconfident.
void add_filter_alone(const Localization& report, Verdict& verdict) {
  constexpr std::size_t few = 100;
  if (report.is_of_images || report.is_smoothed || report.path.size() < few) return;
  verdict.checks.push_back({"σ", report.scale_known ? State::bad : State::care,
                            "the path could not be solved as a whole, and is the filter's: errors may be several times "
                            "their σ",
                            static_cast<double>(report.path.size()), static_cast<double>(few), "frames", "path"});
}

void add_tilt(const Localization& report, Verdict& verdict) {
  constexpr double care_widened = 1.5;
  if (!report.is_from_one_place && !(report.widened > care_widened)) return;
  std::string text =
      report.is_from_one_place
          ? "the camera hardly translates: from one position the tilt of the target is hardly observable, and "
            "errors may be several times their σ"
          : "the tilt of the target is hardly observable: it is seen from one side alone";
  if (report.widened > care_widened) text += "; σ is enlarged " + text_of(report.widened, 2) + " times for it";
  verdict.checks.push_back(
      {"tilt of the target", State::care, std::move(text), report.widened, care_widened, "1", "path"});
  verdict.to_add = "move the camera aside while the target is in view, or use a larger target or one with depth";
}

void add_side(const Localization& report, Verdict& verdict) {
  if (!report.is_behind) return;
  verdict.checks.push_back({"side of the target", State::care,
                            "the target's points are seen from behind (the camera is at their +z): are they, or the "
                            "images, mirrored?",
                            1.0, 0.0, "", "path"});
  verdict.to_add =
      "check that x goes right and y down as the target is seen; if +z is its front, say 'seen_from: +z' in --target";
}

/// In images, innovations say little about σ: a patch is searched for as it looked first, so its error persists from
/// image to image and does not appear as an innovation. In videos with NIS 0.13 to 0.37 the error of the path is 0.6 to
/// 3.4 times its σ; with σ of a match from the innovations, up to 4.7 times.
void add_innovations(const Localization& report, Verdict& verdict) {
  const double nis = report.nis_per_dof;
  constexpr double lasting_low = 0.1;
  const double low = report.is_of_images ? lasting_low : good_nis_low;
  const State state = nis < low ? State::care : state_of(nis, good_nis_high, care_nis);
  const std::string px = text_of(report.sigma_px, 2) + " px";
  std::string said = "innovations as large as predicted";
  if (nis > good_nis_high)
    said = "the observations do not fit: the lens or the noise is not as stated";
  else if (nis < low)
    said = report.is_of_images
               ? "matches are better than the " + px + " that they are taken for, and σ is too large (--sigma-px)"
               : "noise is smaller than the " + px + " stated";
  else if (nis < good_nis_low)
    said = "innovations smaller than the " + px + " of a match: a patch's error lasts from image to image";
  verdict.checks.push_back({"innovations", state, "NIS " + text_of(nis, 3) + " per degree of freedom: " + said, nis,
                            good_nis_high, "1", "nis"});
}

/// Frames without a pose, and rejected observations.
void add_losses(const Localization& report, Verdict& verdict) {
  const double lost = lost_share(report);
  verdict.checks.push_back({"frames lost", state_of(lost, 0.0, care_lost),
                            report.num_lost == 0 ? "no frame lost" : std::to_string(report.num_lost) + " frames lost",
                            lost, care_lost, "1", "tracks"});
  if (report.num_repeated > 0)
    verdict.checks.push_back({"repeated images", State::care,
                              std::to_string(report.num_repeated) +
                                  (report.is_of_images ? " images are the one before them once more, byte for byte,"
                                                       : " frames are the one before them once more, to all digits,") +
                                  " while the camera moves, as of a stream that hangs: there the pose is predicted",
                              static_cast<double>(report.num_repeated), 0.0, "1", "tracks"});
  const double gated = gated_share(report);
  verdict.checks.push_back({"gated", state_of(gated, 0.05, bad_gated),
                            text_of(100.0 * gated, 3) + " % of the observations are rejected", gated, bad_gated, "1",
                            "tracks"});
  if (report.num_known == 0) return;
  // Known points are mismatched as often as others; if more often, their given positions are wrong.
  const double known_gated = share(report.num_known_gated, report.num_known);
  verdict.checks.push_back({"target", state_of(known_gated, 0.1, gated + 0.2),
                            text_of(100.0 * known_gated, 3) + " % of the target's observations are rejected",
                            known_gated, 0.1, "1", "tracks"});
}

std::string scale_text(const Localization& report) {
  if (report.is_scale_read) return "scale from the " + sensors_text(report);
  if (report.scale_known)
    return report.is_in_map ? "scale and frame are those of the map" : "scale from the known points";
  if (report.is_in_map) return "scale unknown: the path's unit is that of the map";
  if (report.has_target) return "none of the target's points is seen: scale and frame are those of the start";
  return "scale unknown: the path is up to scale, its unit is the depth at the start";
}

/// Frame and scale of the map.
void add_frame(const Localization& report, Verdict& verdict) {
  constexpr double max_shift = 3.0;  // χ² of a rectangle's twelve components over their count: 99.9 % is 2.7
  if (report.known_shift > max_shift)
    verdict.checks.push_back({"map's frame", State::care,
                              "the target's points have drifted in the map, " + text_of(std::sqrt(report.known_shift)) +
                                  " times their given σ: the path's position and scale before the target are "
                                  "less sure than its σ says",
                              report.known_shift, max_shift, "1", "path"});
  verdict.checks.push_back(
      {"scale", report.scale_known ? State::good : State::care, scale_text(report), 0.0, 0.0, "", "path"});
}

/// Parts of the images that were masked.
void add_masks(const Localization& report, Verdict& verdict) {
  if (report.lacks_circle)
    verdict.checks.push_back(
        {"mask", State::care, "--mask circle: no image shows a circle, and nothing is masked", 0.0, 0.0, "", "tracks"});
  if (report.still_share > 0.0)
    verdict.checks.push_back({"still parts", State::good,
                              text_of(100.0 * report.still_share, 2) +
                                  " % of the image are edges that never move while the scene does: masked",
                              report.still_share, 0.0, "1", "tracks"});
}

void add_restarts(const Localization& report, Verdict& verdict) {
  if (report.num_restarts > 0)
    verdict.checks.push_back({"restarts", restarts_state(report), restarts_text(report),
                              static_cast<double>(report.num_restarts), 0.0, "times", "path"});
}

/// Adds all checks of a path, in the order of the report.
void add_checks(const Localization& report, Verdict& verdict) {
  for (const auto add :
       {add_innovations, add_losses, add_missing, add_frame, add_map, add_masks, add_restarts, add_sensors, add_imu,
        add_given, add_hidden, add_radial, add_residuals, add_filter_alone, add_tilt, add_side, add_truth})
    add(report, verdict);
}

/// Reason why the result is not a path; empty if it is.
std::optional<Verdict> refusal(const Localization& report) {
  if (std::ranges::none_of(report.path, &PathStep::has_pose)) return never_started(report);
  if (report.num_used == 0 || report.max_seen < 3)
    return stopped(State::refused, ExitCode::undetermined,
                   "too few points: at most " + std::to_string(report.max_seen) + " in a frame, a pose needs three",
                   "track more points");
  const bool is_finite = std::ranges::all_of(report.path, [](const PathStep& step) {
    return !step.has_pose() || (step.world_from_cam.translation.allFinite() && step.cov.allFinite());
  });
  const double gated = gated_share(report);
  if (!is_finite || report.nis_per_dof > max_nis || gated > max_gated)
    return stopped(State::not_converged, ExitCode::no_convergence,
                   "no path fits the observations: NIS " + text_of(report.nis_per_dof, 3) + " per degree of freedom, " +
                       text_of(100.0 * gated, 2) + " % of them rejected",
                   "check camera, target and start, and --sigma-px");
  const double known_gated = share(report.num_known_gated, report.num_known);
  constexpr std::size_t enough_known = 8;
  if (report.num_known >= enough_known && known_gated > max_known_gated)
    return stopped(State::not_converged, ExitCode::no_convergence,
                   "the target is not where it is given: " + text_of(100.0 * known_gated, 3) +
                       " % of its observations do not fit the path",
                   "check the points' numbers and positions in --target");
  if (lost_share(report) > max_lost)
    return stopped(State::refused, ExitCode::undetermined,
                   "lost: " + std::to_string(report.num_lost) + " of " + std::to_string(report.path.size()) +
                       " frames have fewer than three points that fit",
                   "track more points, and keep the target in view for longer");
  if (report.is_behind && report.is_board)
    return stopped(State::refused, ExitCode::undetermined,
                   "mirrored: the observations put the camera behind the printed side of the board",
                   "check that the images are not mirrored, and the order of the board's corners");
  return std::nullopt;
}

/// State and sentence from the checks.
void conclude(const Localization& report, Verdict& verdict) {
  for (const Check& check : verdict.checks) verdict.state = std::max(verdict.state, check.state);
  const std::size_t num_frames = report.path.size();
  verdict.sentence =
      "localised in " + std::to_string(num_frames - report.num_lost) + " of " + std::to_string(num_frames) + " frames";
  for (const Check& check : verdict.checks) {
    if (check.state == State::good || (check.state != verdict.state && check.name != "scale")) continue;
    verdict.sentence += "; " + check.text;
  }
}

/// A filter's linearisation of new points looks like another lens: the lens is tested only if the target is visible in
/// four of five frames.
bool shows_target(const Localization& recent) {
  constexpr std::size_t least_known = 4;
  const auto num = std::ranges::count_if(
      recent.path, [](const PathStep& step) { return step.num_known >= step.num_known_gated + least_known; });
  return 5 * num >= 4 * std::ssize(recent.path);
}

}  // namespace

State state_of(double value, double care, double bad) {
  return value > bad ? State::bad : value > care ? State::care : State::good;
}

Verdict localize_verdict(const Localization& report) {
  if (auto refused = refusal(report)) return *std::move(refused);
  Verdict verdict;
  add_checks(report, verdict);
  conclude(report, verdict);
  heed_assumptions(localize_assumed(report), verdict);
  return verdict;
}

Verdict live_verdict(const Localization& recent) {
  if (std::ranges::none_of(recent.path, &PathStep::has_pose)) return never_started(recent);
  Verdict verdict;
  for (const auto add : {add_innovations, add_losses, add_restarts, add_radial, add_side}) add(recent, verdict);
  if (shows_target(recent)) add_given(recent, verdict);
  for (Check& check : verdict.checks)
    if (check.name == "radial structure" && check.state != State::good)
      check.text += ", or the filter's first map was wrong: the path at the end tells";
  conclude(recent, verdict);
  return verdict;
}

}  // namespace alidade
