#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>

#include "alidade/description/name_list.h"
#include "alidade/rangefinder/checks/cause_checks.h"
#include "alidade/rangefinder/checks/line_offset.h"

namespace alidade {
namespace {

using Status = RangefinderReport::Status;
using Method = RangefinderMethod;

constexpr double refuse_origin_m = 0.1;
constexpr double min_range_ratio = 2.0, min_normal_spread = 0.1;
constexpr double degenerate_range_ratio = 1.3;      // 2.0 to 2.4 m: two methods of three are degenerate
constexpr double degenerate_normal_spread = 0.035;  // tilts of 5°: half of a board's turn is its noise

/// By which method the answer is judged: what the shots used have, whatever was allowed to be used.
Method method_by_shots(const RangefinderReport& report, Method given) {
  bool has_spots = false, has_planes = false;
  for (const ShotFit& fit : report.shots) {
    has_spots = has_spots || (fit.used && fit.residual_px.allFinite());
    has_planes = has_planes || (fit.used && std::isfinite(fit.residual_range_m));
  }
  if (has_spots == has_planes) return has_spots ? Method::joint : given;
  return has_spots ? Method::spot : Method::plane;
}

/// Spots tie origin and direction by where the beam hits, so that their information is never round: one reading of 2 m
/// known to 0.1 mm makes 10⁵ of an origin known to 30 mm, spots from 1.7 to 3.8 m make 10⁴ of one known to 0.04 mm.
/// Neither is degenerate: how well the origin is known, its σ says.
double condition_limit(Method method) { return method == Method::plane ? 1e4 : 1e8; }
/// A spot that is not seen is known by how boards are tilted, to some mrad, which is what its beam illuminates: a
/// hundredth of the image.
double good_spot_px(Method method, const Camera& camera) {
  return method == Method::plane ? std::max(3.0, 0.01 * camera.width_px) : 1.0;
}
/// Spots leave it open along the beam, boards across: one kind alone knows it half as well.
double good_origin_m(Method method) { return method == Method::joint ? 0.01 : 0.02; }

/// What the shots have, whatever the method makes of it.
struct Supply {
  int num_spots = 0, num_planes = 0, num_both = 0;
};

Supply supply_of(std::span<const Shot> shots) {
  Supply supply;
  for (const Shot& shot : shots) {
    supply.num_spots += shot.spot ? 1 : 0;
    supply.num_planes += shot.has_plane() ? 1 : 0;
    supply.num_both += shot.spot && shot.has_plane() ? 1 : 0;
  }
  return supply;
}

/// Which other method could determine it from the same shots, or what another kind of shot would take; ends a sentence.
std::string other_method(Method method, const Supply& supply) {
  if (method == Method::joint) return "";
  if (supply.num_both >= 2) return "; --method joint can use spots and boards of these shots together";
  if (method == Method::plane && supply.num_spots >= 3) return "; --method spot does not need boards";
  return method == Method::plane ? "; or let the spot be seen on the board and use --method joint"
                                 : "; or take the shots on a board and use --method joint";
}

struct Weakness {
  std::string name, what, add;
};

/// Mean angle of the boards' normals to the camera's view, from the cosines.
double mean_tilt_rad(const RangefinderReport& report) {
  double sum = 0.0, num = 0.0;
  for (const ShotFit& shot : report.shots) {
    if (!shot.plane) continue;
    sum += std::acos(std::min(1.0, std::abs(shot.plane->normal_in_cam.z())));
    num += 1.0;
  }
  return num > 0.0 ? sum / num : 0.0;
}

Weakness reason_of_equal_ranges(const RangefinderReport& report) {
  return {"equal ranges",
          "equal ranges: the longest is only " + text_of(report.bound.range_ratio) +
              " times the shortest, so origin and direction cannot be separated",
          "take shots from near to far, at least 1 to 4"};
}

Weakness reason_of_boards(const RangefinderReport& report) {
  constexpr double frontal_rad = 0.14;  // 8°
  if (mean_tilt_rad(report) < frontal_rad) {
    return {"frontal boards", "frontal boards: all face the camera, so where the beam hits them across is unobservable",
            "tilt the board by 20 to 45°, to all sides"};
  }
  return {"parallel boards", "parallel boards: all are tilted equally, so the beam is unobservable along them",
          "tilt the board to all sides"};
}

Weakness reason_of(const RangefinderReport& report, std::span<const Shot> shots, Method method) {
  const BeamBound& bound = report.bound;
  const LineOffset offset = line_offset(report, shots);
  const bool equal = bound.range_ratio < degenerate_range_ratio;
  if (method == Method::plane && bound.normal_spread < degenerate_normal_spread) return reason_of_boards(report);
  if (equal) return reason_of_equal_ranges(report);
  if (method == Method::spot && passes_the_centre(offset)) {
    return {"beam through the optical centre",
            "the beam passes the optical centre by " + text_of(1e3 * offset.value_m, 2) +
                " mm: where along it the origin lies is unobservable",
            "mount the rangefinder a few centimetres beside the camera"};
  }
  if (method == Method::plane && bound.normal_spread < min_normal_spread) return reason_of_boards(report);
  if (bound.range_ratio < min_range_ratio) return reason_of_equal_ranges(report);
  return {"too little",
          "too little for this noise: the origin is known to " + text_of(1e3 * bound.sigma_origin_m, 2) + " mm only",
          "add shots from near to far, the board tilted to all sides"};
}

/// Boards seen from behind: of mirrored images all that is left and right is exchanged, the beam too.
void add_handedness(const RangefinderReport& report, Verdict& verdict) {
  const bool is_plain = report.boards_behind == 0;
  verdict.checks.push_back(check_of("mirrored", is_plain ? State::good : State::care,
                                    is_plain ? "boards are seen from the front"
                                             : std::to_string(report.boards_behind) +
                                                   " boards are seen from behind: of mirrored images the beam is "
                                                   "mirrored, too; give images as the camera takes them, corners row "
                                                   "by row, left to right",
                                    report.boards_behind, 0.0, "", ""));
}

Verdict refusal(State state, ExitCode code, const std::string& sentence, const std::string& add) {
  return {state, code, sentence, add, {}};
}

State graded(double value, double good, double refuse) {
  return !(value < refuse) ? State::refused : value > good ? State::care : State::good;
}

void add_precision(const RangefinderReport& report, Method method, Verdict& verdict) {
  const BeamBound& bound = report.bound;
  verdict.checks.push_back(check_of("origin", graded(bound.sigma_origin_m, good_origin_m(method), refuse_origin_m),
                                    "σ of the origin is " + text_of(1e3 * bound.sigma_origin_m, 2) + " mm",
                                    1e3 * bound.sigma_origin_m, 1e3 * good_origin_m(method), "mm", "precision"));
  const double spot_px = bound.worst_spot_sigma_px;
  verdict.checks.push_back(
      check_of("spot", spot_px <= good_spot_px(method, report.camera) ? State::good : State::care,
               "σ of the predicted spot is up to " + text_of(spot_px, 2) + " px from " +
                   text_of(std::clamp(bound_ranges_m.front(), bound.nearest_m, bound.farthest_m), 2) + " to " +
                   text_of(std::clamp(bound_ranges_m.back(), bound.nearest_m, bound.farthest_m), 2) + " m",
               spot_px, good_spot_px(method, report.camera), "px", "precision"));
  const double limit = condition_limit(method);
  verdict.checks.push_back(check_of("condition", bound.condition <= limit ? State::good : State::refused,
                                    "condition number of the information " + text_of(bound.condition, 2),
                                    bound.condition, limit, "", "precision"));
}

void add_geometry(const RangefinderReport& report, std::span<const Shot> shots, Method method, Verdict& verdict) {
  const BeamBound& bound = report.bound;
  verdict.checks.push_back(check_of("ranges", bound.range_ratio >= min_range_ratio ? State::good : State::care,
                                    "the longest range is " + text_of(bound.range_ratio) + " times the shortest",
                                    bound.range_ratio, min_range_ratio, "", "next"));
  if (method != Method::spot && bound.normal_spread > 0.0) {
    // With the spot seen, tilts do not matter: the figure is shown, it decides nothing.
    State state = bound.normal_spread >= min_normal_spread || method == Method::joint ? State::good : State::care;
    if (method == Method::plane && bound.normal_spread < 0.5 * degenerate_normal_spread) state = State::refused;
    verdict.checks.push_back(check_of("tilts", state,
                                      "the boards' normals spread by " + text_of(bound.normal_spread, 2),
                                      bound.normal_spread, min_normal_spread, "", "next"));
  }
  if (method == Method::spot) {
    const LineOffset offset = line_offset(report, shots);
    verdict.checks.push_back(
        check_of("offset", passes_the_centre(offset) ? State::refused : State::good,
                 "the beam passes the optical centre by " + text_of(1e3 * offset.value_m, 2) + " mm",
                 1e3 * offset.value_m, 3e3 * offset.sigma_m, "mm", "precision"));
  }
}

/// Measurements beyond what the beam takes: with none to spare a wrong shot biases the beam and leaves no residual.
void add_spare(const RangefinderReport& report, Verdict& verdict) {
  constexpr int enough = 3;
  int spare = report.beam.cov(beam_scale_param, beam_scale_param) > 0.0 ? -6 : -5;
  for (const ShotFit& fit : report.shots) {
    if (!fit.used) continue;
    spare += (std::isfinite(fit.residual_range_m) ? 1 : 0) + (fit.residual_px.allFinite() ? 2 : 0);
  }
  const std::string text = "only " + std::to_string(spare) + " measurement" + (spare == 1 ? "" : "s") +
                           " to spare: a wrong shot would go unnoticed; take more";
  verdict.checks.push_back(check_of("to spare", spare < enough ? State::care : State::good,
                                    spare < enough ? text : std::to_string(spare) + " measurements to spare", spare,
                                    enough, "", "residuals"));
}

/// Boards that are there but fit no pose: another board, or another camera. Without them a shot has its spot alone.
void add_boards(const RangefinderReport& report, std::span<const Shot> shots, Verdict& verdict) {
  int given = 0, unfit = 0;
  for (std::size_t i = 0; i < shots.size() && i < report.shots.size(); ++i) {
    given += shots[i].board ? 1 : 0;
    unfit += shots[i].board && !report.shots[i].plane ? 1 : 0;
  }
  if (given == 0) return;
  verdict.checks.push_back(check_of("boards",
                                    unfit == 0       ? State::good
                                    : unfit == given ? State::refused
                                                     : State::care,
                                    unfit == 0 ? "each board fits its corners"
                                               : "no pose of the board fits its corners in " + std::to_string(unfit) +
                                                     " of " + std::to_string(given) + " shots",
                                    unfit, 0.0, "", "residuals"));
}

void add_fit(const RangefinderReport& report, std::span<const Shot> shots, Verdict& verdict) {
  int outliers = 0;
  std::vector<std::string> named;
  for (std::size_t i = 0; i < report.shots.size(); ++i) {
    if (report.shots[i].used || report.shots[i].reason.rfind("outlier", 0) != 0) continue;
    named.push_back(i < shots.size() && !shots[i].name.empty() ? shots[i].name : "shot " + std::to_string(i + 1));
    ++outliers;
  }
  const int considered = report.shots_used + outliers;
  // Where two in five do not agree with the rest, the rest may be as wrong.
  const State state = outliers == 0 ? State::good : 5 * outliers > 2 * considered ? State::refused : State::care;
  verdict.checks.push_back(check_of("outliers", state,
                                    outliers == 0 ? "all shots agree" : "rejected: " + name_list(named), outliers,
                                    0.4 * considered, "", "residuals"));
  if (report.dof < 1 || (report.spot_sigma_is_estimated && report.range_sigma_is_estimated)) return;
  const double ratio = std::sqrt(report.cost / report.dof);
  const double most = 1.0 + 3.0 / std::sqrt(2.0 * report.dof) + 0.2;
  verdict.checks.push_back(check_of("fit", ratio < most ? State::good : State::care,
                                    "residuals are " + text_of(ratio, 2) + " times their σ", ratio, most, "",
                                    "residuals"));
}

/// A singular information has no clusters: of that others speak.
void add_clusters(const RangefinderReport& report, Verdict& verdict) {
  const bool is_few = report.shots_used < static_cast<int>(ClusterCovariance::min_clusters);
  if (report.clusters.z2.empty() && !is_few) return;
  verdict.checks.push_back(
      clusters_agree(report.clusters, "shot",
                     "a lens or a square that is off, spots or corners that err alike, a bowed board", "residuals"));
}

Verdict refusal_by_status(const RangefinderReport& report, Method method, const Supply& supply) {
  if (report.status == Status::scale_unknown) {
    return refusal(State::refused, ExitCode::undetermined,
                   "the scale of the ranges cannot be determined from spots alone",
                   "take shots on a board and use --method joint, or estimate no --scale");
  }
  if (report.status == Status::too_few) {
    const char* needed = method == Method::spot    ? "three with a spot"
                         : method == Method::plane ? "six with a board"
                                                   : "two with spot and board";
    return refusal(
        State::refused, ExitCode::undetermined,
        "too few shots: of " + std::to_string(report.shots.size()) + " given, " + needed + " or more must be usable",
        "add shots from near to far" + other_method(method, supply));
  }
  if (report.status == Status::ambiguous) {
    return refusal(State::refused, ExitCode::undetermined, "two beams explain these shots equally well",
                   "add a shot or two with the board tilted to another side" + other_method(method, supply));
  }
  return refusal(State::not_converged, ExitCode::no_convergence, "no beam explains these shots",
                 "check the ranges' unit, that each spot and board belongs to its range, and the camera file");
}

const Check* find_check(std::span<const Check> checks, State state, std::string_view name = {}) {
  const auto at = std::ranges::find_if(
      checks, [&](const Check& check) { return check.state == state && (name.empty() || check.name == name); });
  return at != checks.end() ? &*at : nullptr;
}

/// Of shots that were solved for, what a check says that refuses them for a cause of its own.
std::optional<Verdict> refusal_by_check(const RangefinderReport& report, std::span<const Check> checks) {
  if (const Check* const scale = find_check(checks, State::refused, "scale"))
    return refusal(State::refused, ExitCode::undetermined, scale->text,
                   "give the ranges in metres; a scale that is known to be so: --scale");
  const Check* const noise = find_check(checks, State::refused, "range noise");
  if (noise != nullptr && report.status == Status::converged)
    return refusal(State::not_converged, ExitCode::no_convergence, noise->text,
                   "check that each range belongs to its spot and board, that the beam hit the board, and the unit");
  const Check* const first = find_check(checks, State::refused);
  if (first != nullptr && first->name == "outliers")
    return refusal(State::not_converged, ExitCode::no_convergence, "the shots do not agree: " + first->text,
                   "check that the beam hit the board in each");
  if (first != nullptr && first->name == "boards")
    return refusal(State::refused, ExitCode::undetermined, first->text,
                   "check --board, --square and the camera; --method spot does without boards");
  return std::nullopt;
}

Verdict refusal_by_geometry(const RangefinderReport& report, std::span<const Shot> shots, Method method,
                            std::vector<Check>& checks) {
  const Weakness reason = reason_of(report, shots, method_by_shots(report, method));
  Verdict verdict =
      refusal(State::refused, ExitCode::undetermined, reason.what, reason.add + other_method(method, supply_of(shots)));
  for (const Check& check : checks)
    if (check.state == State::care && (check.name == "columns" || check.name == "spots outside"))
      verdict.to_add += "; " + check.text;
  checks.push_back(check_of(reason.name, State::refused, reason.what, 0.0, 0.0, "", "next"));
  return verdict;
}

/// A beam with its σ, and what to do about the check that is least content.
Verdict verdict_of_beam(const RangefinderReport& report, std::span<const Check> checks) {
  Verdict verdict;
  if (const Check* const care = find_check(checks, State::care)) {
    verdict.state = State::care;
    verdict.to_add = care->text;
    if (care->name == "origin" || care->name == "spot")
      verdict.to_add +=
          ": add shots at other ranges, of boards tilted otherwise; `alidade plan rangefinder` says which";
    // What is wrong comes before what follows from it.
    for (const std::string_view cause :
         {"shots agree", "spots by distance", "bend", "incidence", "sheet", "drift", "wander", "scale", "fit",
          "outliers", "boards", "camera", "distortion", "bent", "noise told", "spots outside", "columns", "mirrored"})
      for (const Check& check : checks)
        if (check.name == cause && check.state == State::care) verdict.to_add = check.text;
  }
  const Eigen::Vector3d mm = 1e3 * report.beam.origin_in_cam;
  verdict.sentence = "origin (" + text_of(mm.x()) + ", " + text_of(mm.y()) + ", " + text_of(mm.z()) + ") mm ± " +
                     text_of(3e3 * report.bound.sigma_origin_m, 2) + " mm, direction ± " +
                     text_of(3e3 * report.bound.sigma_direction_rad, 2) + " mrad (3σ) from " +
                     std::to_string(report.shots_used) + " shots";
  return verdict;
}

std::vector<Check> checks_of(const RangefinderReport& report, std::span<const Shot> shots,
                             const RangefinderConfig& config) {
  Verdict verdict;
  const Method method = method_by_shots(report, config.method);
  add_precision(report, method, verdict);
  add_geometry(report, shots, method, verdict);
  add_fit(report, shots, verdict);
  add_clusters(report, verdict);
  if (config.method != Method::spot) add_boards(report, shots, verdict);
  add_spare(report, verdict);
  RangefinderConfig judged = config;
  judged.method = method;
  add_cause_checks(report, shots, judged, verdict);
  add_handedness(report, verdict);
  return std::move(verdict.checks);
}

}  // namespace

Verdict rangefinder_verdict(const RangefinderReport& report, std::span<const Shot> shots,
                            const RangefinderConfig& config) {
  const bool is_solved = report.status == Status::converged || report.status == Status::degenerate ||
                         report.status == Status::no_convergence || report.status == Status::ambiguous;
  std::vector<Check> checks = is_solved ? checks_of(report, shots, config) : std::vector<Check>{};
  Verdict verdict;
  if (auto refused = refusal_by_check(report, checks))
    verdict = *std::move(refused);
  else if (report.status == Status::degenerate || find_check(checks, State::refused) != nullptr)
    verdict = refusal_by_geometry(report, shots, config.method, checks);
  else if (report.status != Status::converged)
    verdict = refusal_by_status(report, config.method, supply_of(shots));
  else
    verdict = verdict_of_beam(report, checks);
  verdict.checks = std::move(checks);
  return verdict;
}

}  // namespace alidade
