#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "alidade/estimation/median.h"
#include "alidade/geometry/degree.h"
#include "alidade/network/moving_target.h"

namespace alidade {
namespace {

using PlacedStatus = MovingTargetReport::Status;
constexpr double good_turn_rad = 0.2 * degree, refuse_turn_rad = 2.0 * degree;
constexpr double good_share = 0.01, refuse_share = 0.1;  // σ of a position over the cameras' distance

Verdict moving_refusal(std::string sentence, std::string add) {
  return {State::refused, ExitCode::undetermined, std::move(sentence), std::move(add), {}};
}

/// What to try differs where each camera may have a clock of its own.
Verdict refusal_of_clocks(PlacedStatus status, bool searches_clocks) {
  switch (status) {
    case PlacedStatus::too_few:
      return moving_refusal("no two cameras saw the target together in 30 moments or more",
                            searches_clocks
                                ? "let the target move where the cameras' views overlap, or raise --clocks"
                                : "let the target move where the views overlap; where each camera has its own clock, "
                                  "give --clocks SECONDS");
    case PlacedStatus::no_pair:
      return moving_refusal(searches_clocks ? "no two cameras' observations agree at any difference of their clocks"
                                            : "no two cameras' observations agree: their clocks differ, or a lens is "
                                              "wrong",
                            searches_clocks ? "raise --clocks; check the lenses and their order"
                                            : "give --clocks SECONDS; check the lenses and their order");
    case PlacedStatus::truth_misfits:
      return moving_refusal("the path that was seen is not the true path given, whatever its scale",
                            searches_clocks ? "check that --truth is of the same flight and metres"
                                            : "give --clocks SECONDS where the true path has a clock of its own");
    default:
      return moving_refusal("no path fits what the cameras saw by one clock",
                            "give --clocks SECONDS where each camera has its own clock; check the lenses, and that one "
                            "target only is in the table");
  }
}

Verdict refusal_by_status(const MovingTargetReport& report, const MovingTargetConfig& config) {
  const bool searches_clocks = config.clock_search_s > 0.0;
  switch (report.status) {
    case PlacedStatus::degenerate:
      return moving_refusal("the cameras' positions cannot be determined from this path",
                            "let the target move in all three directions and near the cameras, not along a line");
    case PlacedStatus::no_scale:
      return moving_refusal(
          "the scale cannot be determined: all lengths grow with the path",
          "give the distance of two located cameras (--distance 1:2:12.5), or the target's path (--truth)");
    case PlacedStatus::no_convergence:
      if (!searches_clocks) return refusal_of_clocks(report.status, false);
      return {State::not_converged,
              ExitCode::no_convergence,
              "the estimate does not settle",
              "check the lenses and that one target only is in the table",
              {}};
    case PlacedStatus::placed:
      return {};
    default:
      return refusal_of_clocks(report.status, searches_clocks);
  }
}

/// The largest distance of two located cameras.
double spread_m(const MovingTargetReport& report) {
  double most = 0.0;
  for (std::size_t a = 0; a < report.cameras.size(); ++a)
    for (std::size_t b = 0; b < a; ++b)
      if (report.cameras[a].placed && report.cameras[b].placed)
        most = std::max(most, (report.rig.heads[a].head.world_from_base.translation -
                               report.rig.heads[b].head.world_from_base.translation)
                                  .norm());
  return most;
}

State state_between(double value, double good, double refuse) {
  return !(value < refuse) ? State::refused : value < good ? State::good : State::care;
}

void add_precision(const MovingTargetReport& report, Verdict& verdict) {
  const double spread = spread_m(report), sigma_m = report.sigma_relative_m, sigma_rad = report.sigma_relative_rad;
  verdict.checks.push_back({"rotation", state_between(sigma_rad, good_turn_rad, refuse_turn_rad),
                            "σ of a camera's attitude " + text_of(sigma_rad / degree, 2) + "°", sigma_rad / degree,
                            good_turn_rad / degree, "°", ""});
  verdict.checks.push_back(
      {"position", state_between(sigma_m / spread, good_share, refuse_share),
       "σ of a camera's position " + text_of(sigma_m, 2) + " m, of " + text_of(spread, 3) + " m between cameras",
       sigma_m, good_share * spread, "m", ""});
}

void add_cameras(const MovingTargetReport& report, Verdict& verdict) {
  std::string left;
  std::size_t num_left = 0;
  for (const LocatedCamera& camera : report.cameras) {
    if (camera.placed) continue;
    ++num_left;
    left += (left.empty() ? "head " : "; head ") + std::to_string(camera.id) + ": " + camera.reason;
  }
  verdict.checks.push_back({"cameras", num_left == 0 ? State::good : State::care,
                            num_left == 0 ? "all located" : "not located: " + left, static_cast<double>(num_left), 1.0,
                            "", ""});
  // Hands and lenses err for long stretches: that σ is several times larger is usual here, and counted.
  Check agree = clusters_agree(report.clusters, "block",
                               text_of(report.block_s, 2) + " s of a hand's or a lens's errors", "path");
  if (!report.clusters.z2.empty()) agree.state = State::good;
  verdict.checks.push_back(agree);
}

/// Where σ is too large: cameras that agree far worse than others, and of four or more which one. Of three, what one
/// does the path takes over, and another agrees worst.
void put_worst_first(const MovingTargetReport& report, Verdict& verdict) {
  constexpr double far_worse = 3.0;
  constexpr std::size_t enough = 4;
  std::vector<const LocatedCamera*> placed;
  for (const LocatedCamera& camera : report.cameras)
    if (camera.placed) placed.push_back(&camera);
  const auto is_precise = [](const Check& check) { return check.state == State::good; };
  if (placed.size() < 3 || std::ranges::all_of(verdict.checks, is_precise)) return;
  std::ranges::sort(placed, std::ranges::greater{}, &LocatedCamera::sigma_px);
  const double worst = placed[0]->sigma_px, next = placed[1]->sigma_px;
  if (worst < far_worse * next) return;
  const bool is_known = placed.size() >= enough;
  const std::string who = is_known ? "head " + std::to_string(placed[0]->id) + " agrees" : "one camera agrees";
  verdict.checks.insert(verdict.checks.begin(), {"one camera", State::care,
                                                 who + " to " + text_of(worst, 2) + " px only, the others to " +
                                                     text_of(next, 2) + " px: " + (is_known ? "it" : "one of them") +
                                                     " was moved, or its clock or its lens is another",
                                                 worst / next, far_worse, "", ""});
}

std::string asked_text(const CameraScore& one) {
  const std::string by = text_of(std::abs(one.asked), 2), ms = text_of(1e3 * std::abs(one.asked), 2) + " ms";
  switch (one.part) {
    case CameraPart::focal:
      return "a focal length " + text_of(100.0 * std::abs(one.asked), 2) + " % " +
             (one.asked > 0.0 ? "longer" : "shorter") + " than its camera file's";
    case CameraPart::cx:
      return "a principal point " + by + " px " + (one.asked > 0.0 ? "right" : "left") + " of its camera file's";
    case CameraPart::cy:
      return "a principal point " + by + " px " + (one.asked > 0.0 ? "below" : "above") + " its camera file's";
    case CameraPart::k1:
      return "a distortion other than its camera file's, k1 by " + text_of(one.asked, 2);
    case CameraPart::clock:
      return "a clock that is " + ms + (one.asked > 0.0 ? " ahead of" : " behind") + " the others'";
    case CameraPart::shutter:
    case CameraPart::shutter_from_top:
      return "a shutter that takes " + ms + " from the " + (one.asked > 0.0 ? "top" : "bottom") + " row on";
    default:
      return "an attitude that changes by about " + text_of(std::abs(one.asked) / degree, 2) +
             "° over its observations";
  }
}

std::string asking_text(const MovingTargetReport& report, const CameraScore& one) {
  const std::string by = ", by " + text_of(one.sigmas(), 2) + "σ: ",
                    clocks = "give --clocks SECONDS, which estimates each camera's clock";
  const auto num = std::ranges::count(report.cameras, true, &LocatedCamera::placed);
  if (one.part == CameraPart::clock && num == 2)  // which of the two, nothing tells
    return "the two cameras' clocks differ by " + text_of(1e3 * std::abs(one.asked), 2) + " ms" + by + clocks;
  std::string text =
      "head " + std::to_string(report.cameras[one.head].id) + ": the observations ask for " + asked_text(one) + by;
  if (one.part <= CameraPart::k1) return text + "is the file of this lens at this zoom?";
  if (one.part == CameraPart::clock) return text + clocks;
  if (one.part <= CameraPart::shutter_from_top)
    return text + "rows are exposed one after the other; give the time of the row that saw the target";
  return text + "was it moved? give the table of the time before, or after";
}

/// What the observations contradict most: of all that they contradict, what leaves the least of the residuals.
void add_scores(const MovingTargetReport& report, Verdict& verdict) {
  if (report.scores.empty()) return;
  const auto rank = [](const CameraScore& one) {
    return std::pair(one.sigmas() >= camera_limit ? one.gain : 0.0, one.sigmas());
  };
  const CameraScore& most = *std::ranges::max_element(report.scores, {}, rank);
  const bool is_quiet = most.sigmas() < camera_limit;
  const std::string text = is_quiet ? "neither another lens, clock or shutter nor a move of a camera is indicated"
                                    : asking_text(report, most);
  verdict.checks.push_back(
      {"causes", is_quiet ? State::good : State::care, text, most.sigmas(), camera_limit, "σ", ""});
}

/// A camera that was moved, by what was rejected: where it is holds for a part of the time.
void add_rejected(const MovingTargetReport& report, Verdict& verdict) {
  constexpr double many = 0.35;
  const auto add = [&](const std::string& text, double value) {
    verdict.checks.push_back({"observations", State::care, text, value, many, "", ""});
  };
  for (const LocatedCamera& camera : report.cameras)
    if (camera.placed && camera.moved)
      return add("head " + std::to_string(camera.id) + " was moved at " + text_of(camera.moved->t_s, 4) +
                     " s, or its clock jumped: what it saw " + (camera.moved->agrees_before ? "after" : "before") +
                     " that does not agree; give the table without it",
                 camera.rejected);
  if (report.disagree)
    return add(std::string("the cameras agree ") + (report.disagree->agrees_before ? "until " : "from ") +
                   text_of(report.disagree->t_s, 4) + " s" + (report.disagree->agrees_before ? "" : " on") +
                   " only: one of them was moved then, or its clock jumped",
               1.0 - report.agreeing);
  for (const LocatedCamera& camera : report.cameras)
    if (camera.placed && camera.rejected > many)
      return add("head " + std::to_string(camera.id) + ": " + text_of(100.0 * camera.rejected, 2) +
                     " % of its observations do not agree with the others': false labels, another target, or a camera "
                     "that was moved",
                 camera.rejected);
}

/// A true path in millimetres gives a rig of kilometres that fits as well.
void add_speed(const MovingTargetReport& report, Verdict& verdict) {
  constexpr double beyond_any_m_s = 500.0;
  std::vector<double> speeds_m_s;
  for (std::size_t i = 1; i < report.path.size(); ++i)
    if (const double apart_s = report.path_t_s[i] - report.path_t_s[i - 1]; apart_s > 0.0)
      speeds_m_s.push_back((report.path[i] - report.path[i - 1]).norm() / apart_s);
  const double speed_m_s = median_of(std::move(speeds_m_s));
  if (speed_m_s < beyond_any_m_s) return;
  verdict.checks.push_back({"true path's unit", State::care,
                            "by the true path the target moves at " + text_of(speed_m_s, 2) +
                                " m/s: is the path in metres, and are its times in seconds?",
                            speed_m_s, beyond_any_m_s, "m/s", ""});
}

void add_truth(const MovingTargetReport& report, Verdict& verdict) {
  if (!(report.truth_covered > 0.0)) return;
  add_speed(report, verdict);
  verdict.checks.push_back({"true path", report.truth_covered > 0.9 ? State::good : State::care,
                            "met within " + text_of(report.truth_median_m, 2) +
                                " m (median) after a similarity, over " + text_of(100.0 * report.truth_covered) +
                                " % of the path",
                            report.truth_median_m, 0.0, "m", ""});
  constexpr double good_world = 0.03;  // σ over the cameras' distance: a receiver's, over a minute, is better
  const double spread = spread_m(report);
  const bool is_known = report.sigma_world_m < good_world * spread;
  verdict.checks.push_back({"true path's frame", is_known ? State::good : State::care,
                            "σ of a camera's position in the true path's frame " + text_of(report.sigma_world_m, 2) +
                                " m" +
                                (is_known ? ""
                                          : ": a path that lies on itself when it is turned, as a circle, or a "
                                            "true path with errors determines no more"),
                            report.sigma_world_m, good_world * spread, "m", ""});
}

/// Where all clocks were taken as one.
void add_truth_clock(const MovingTargetReport& report, Verdict& verdict) {
  constexpr double limit = 4.2;
  if (!(report.sigma_truth_late_s > 0.0)) return;
  const double sigmas = std::abs(report.truth_late_s) / report.sigma_truth_late_s;
  const bool is_one = sigmas < limit;
  verdict.checks.push_back({"true path's clock", is_one ? State::good : State::care,
                            is_one ? "the true path's times are the observations'"
                                   : "the true path's times are " + text_of(std::abs(report.truth_late_s), 2) +
                                         (report.truth_late_s > 0.0 ? " s late" : " s early") + ", by " +
                                         text_of(sigmas, 2) + "σ: give --clocks SECONDS, which estimates its clock",
                            sigmas, limit, "σ", ""});
}

}  // namespace

Verdict moving_target_verdict(const MovingTargetReport& report, const MovingTargetConfig& config) {
  if (report.camera_fault.starts_with("the clock"))
    return moving_refusal(report.camera_fault, "give --clocks SECONDS, which estimates each camera's clock");
  if (!report.camera_fault.empty())
    return moving_refusal(report.camera_fault,
                          "give images as the camera takes them (no mirror, no flip), and cameras in the order of the "
                          "heads' numbers");
  if (report.status != PlacedStatus::placed) return refusal_by_status(report, config);
  Verdict verdict;
  add_precision(report, verdict);
  put_worst_first(report, verdict);  // what is wrong comes before what follows from it
  Verdict causes;
  add_rejected(report, causes);
  add_scores(report, causes);
  add_truth_clock(report, causes);
  verdict.checks.insert(verdict.checks.begin(), causes.checks.begin(), causes.checks.end());
  add_cameras(report, verdict);
  add_truth(report, verdict);
  const auto first = [&](State state) {
    return std::ranges::find_if(verdict.checks, [&](const Check& check) { return check.state == state; });
  };
  if (const auto refused = first(State::refused); refused != verdict.checks.end()) {
    Verdict no = moving_refusal("too little to locate the cameras: " + refused->text,
                                "let the target move in all three directions, nearer to the cameras, and for longer");
    no.checks = verdict.checks;
    return no;
  }
  if (const auto care = first(State::care); care != verdict.checks.end()) {
    verdict.state = State::care;
    verdict.to_add = care->text;
  }
  const auto num = std::ranges::count(report.cameras, true, &LocatedCamera::placed);
  const bool in_world = report.sigma_world_m > 0.0;
  const double sigma_m = in_world ? report.sigma_world_m : report.sigma_relative_m;
  const double sigma_rad = in_world ? report.sigma_world_rad : report.sigma_relative_rad;
  verdict.sentence = std::to_string(num) + " cameras located by a moving target, ± " +
                     text_of(3.0 * sigma_rad / degree, 2) + "°, ± " + text_of(3.0 * sigma_m, 2) + " m (3σ)";
  heed_assumptions(report.assumed, verdict);
  return verdict;
}

}  // namespace alidade
