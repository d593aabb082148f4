#include "alidade/rangefinder/checks/cause_checks.h"
#include "alidade/estimation/median.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/degree.h"
#include "alidade/rangefinder/prepare.h"

namespace alidade {
namespace {

/// The name of the unit that the readings are in, by their scale; empty where they are metres, or in none.
std::string unit_of(double scale) {
  constexpr double near_enough = 0.01;
  for (const auto& [metres, name] : {std::pair{0.001, "millimetres"}, std::pair{0.01, "centimetres"},
                                     std::pair{0.0254, "inches"}, std::pair{0.3048, "feet"}})
    if (std::abs(scale / metres - 1.0) < near_enough) return name;
  return "";
}

/// A scale that was estimated as nobody gave it, and is not 1: the rangefinder's, or that of the board.
void add_found_scale(const RangefinderReport& report, Verdict& verdict) {
  constexpr double ask_beyond = 4.0, beyond_chance = 2.0, beyond_an_instrument = 0.05;
  const double away = report.beam.scale - 1.0, z = std::abs(report.scale_in_sigmas);
  Check check = check_of("scale", z < ask_beyond ? State::good : State::care, "the readings' scale is 1 within its σ",
                         z, ask_beyond, "σ", "residuals");
  if (z >= beyond_chance)
    check.text = "the readings are " + text_of(1.0 / report.beam.scale, 5) + " times what the board says (" +
                 text_of(z, 2) +
                 "σ): the printed squares (measure them), the camera's focal length, or the rangefinder's scale "
                 "(where it is known to have one, give --scale): the shots cannot tell which";
  if (z >= ask_beyond && std::abs(away) > beyond_an_instrument) {
    const std::string unit = unit_of(report.beam.scale);
    check.state = State::refused;
    check.text = unit.empty()
                     ? "no rangefinder is off so far: the readings are " + text_of(1.0 / report.beam.scale, 3) +
                           " times what the board says; is the file that of another camera, or the square "
                           "another?"
                     : "the ranges are " + unit + ", not metres: they are " + text_of(1.0 / report.beam.scale, 3) +
                           " times what the board says";
  }
  verdict.checks.push_back(std::move(check));
}

/// With --scale: one that squares of that length would give as well. More than this few rangefinders have.
void add_asked_scale(const RangefinderReport& report, const RangefinderConfig& config, Verdict& verdict) {
  constexpr double beyond_most = 0.015;
  const double away = report.beam.scale - 1.0;
  if (!config.estimate_scale || config.scale_by_need || !unit_of(report.beam.scale).empty()) return;
  if (config.method == RangefinderMethod::spot || std::abs(away) < beyond_most) return;
  verdict.checks.push_back(check_of("scale", State::care,
                                    "the readings' scale is " + text_of(100.0 * std::abs(away), 3) +
                                        " % off, more than most rangefinders': squares that are " +
                                        text_of(100.0 * std::abs(away), 3) + " % " +
                                        (away < 0.0 ? "longer" : "shorter") + " than given look the same: measure them",
                                    std::abs(away), beyond_most, "", "residuals"));
}

void add_scale(const RangefinderReport& report, const RangefinderConfig& config, Verdict& verdict) {
  if (config.scale_by_need) add_found_scale(report, verdict);
  const std::string unit = config.estimate_scale && !config.scale_by_need ? unit_of(report.beam.scale) : "";
  if (!unit.empty())
    verdict.checks.push_back(check_of("scale", State::care, "the ranges are " + unit + ", not metres",
                                      report.beam.scale, 1.0, "", "residuals"));
  add_asked_scale(report, config, verdict);
  constexpr double ask_beyond = 4.0;
  const double z = config.scale_by_need ? 0.0 : std::abs(report.scale_in_sigmas);
  if (z == 0.0) return;
  verdict.checks.push_back(check_of("scale", z < ask_beyond ? State::good : State::care,
                                    z < ask_beyond ? "no scale of the readings is indicated"
                                                   : "the readings indicate a scale: --scale (" + text_of(z, 2) + " σ)",
                                    z, ask_beyond, "σ", "residuals"));
}

/// "a focal length of 710 px, not 700": what the shots ask for.
std::string asked_of_lens(const FixedQuantity& thing) {
  const std::string name = thing.name.substr(thing.name.find('.') + 1);
  const bool is_pixels = name == "f" || name.starts_with("c");
  return (name == "f"             ? "a focal length of "
          : name.starts_with("c") ? "a centre " + name + " of "
          : name.starts_with("p") ? "a tangential distortion " + name + " of "
                                  : "a distortion " + name + " of ") +
         text_of(thing.value + thing.asked, is_pixels ? 5 : 3) + (is_pixels ? " px, not " : ", not ") +
         text_of(thing.value, is_pixels ? 5 : 3);
}

constexpr double bend_beyond = 3.5, flat_m = 0.0003;

/// By how many σ the shots ask for another lens.
double lens_sigmas(const RangefinderReport& report) {
  double lens = 0.0;
  for (const FixedQuantity& thing : report.fixed)
    if (thing.name.starts_with("camera")) lens = std::max(lens, std::abs(thing.asked) / thing.asked_sigma);
  for (const FreedDistortion& one : report.freed_distortion)
    lens = std::max(lens, std::abs(one.value - one.was) / one.sigma);
  return lens;
}

/// A board that is bent so much that it is no flat board, by more than another lens would explain of the same.
const ShotCause* bent_board(const RangefinderReport& report) {
  const auto bent = std::ranges::find(report.causes, "bent", &ShotCause::name);
  if (bent == report.causes.end() || !(bent->sigmas > bend_beyond) || !(bent->size > flat_m)) return nullptr;
  return bent->sigmas > lens_sigmas(report) ? &*bent : nullptr;
}

void add_bent_board(const RangefinderReport& report, Verdict& verdict) {
  const auto found = std::ranges::find(report.causes, "bent", &ShotCause::name);
  if (found == report.causes.end()) return;
  const std::string bends = "by " + text_of(1e3 * found->size, 2) + " mm (" + text_of(found->sigmas, 2) + "σ)";
  Check check =
      check_of("bent", State::good, "no bend of the board is indicated", found->sigmas, bend_beyond, "σ", "residuals");
  if (bent_board(report) != nullptr) {
    check.state = State::care;
    check.text = "the board is not flat: it bends " + bends + ", counted in σ: glue it to something flat";
  } else if (found->sigmas > bend_beyond && found->size <= flat_m) {
    check = check_of("bent", State::good, "the board bends " + bends + ", which is flat enough", 1e3 * found->size,
                     1e3 * flat_m, "mm", "residuals");
  } else if (found->sigmas > bend_beyond) {
    check.text = "another lens explains more than a bend of the board " + bends + " would";
    check.limit = lens_sigmas(report);
  }
  verdict.checks.push_back(std::move(check));
}

/// Terms of higher order look like k1 and k2.
std::string or_k3(const Camera& camera) {
  const std::vector<std::string> names = param_names(camera.lens);
  const auto at = std::ranges::find(names, "k3") - names.begin();
  const bool has_k3 = at < std::ssize(names) && params(camera.lens)[at] != 0.0;
  return has_k3 ? "" : ", or a k3, which the file does not have";
}

/// Do boards and spots ask for another lens than the file's?
void add_camera(const RangefinderReport& report, Verdict& verdict) {
  constexpr double ask_beyond = 4.5, foreign = 0.02;
  Check check =
      check_of("camera", State::good, "boards and spots agree with the camera file", 0.0, ask_beyond, "σ", "residuals");
  const bool is_bent = bent_board(report) != nullptr;
  const bool may_bend = std::ranges::count(report.fixed, "board.flat_m", &FixedQuantity::name) > 0;
  for (const FixedQuantity& thing : report.fixed) {
    if (!thing.name.starts_with("camera")) continue;
    const double z = std::abs(thing.asked) / thing.asked_sigma;
    if (!(z > check.value)) continue;
    check.value = z;
    if (z < ask_beyond) continue;
    check.state = State::care;
    const bool is_focal = thing.name == "camera.f";
    check.text = "the shots indicate " + asked_of_lens(thing) + " (" + text_of(z, 2) + "σ)";
    if (thing.name.starts_with("camera.k")) check.text += or_k3(report.camera);
    if (is_bent)
      check.text += ", which the bend of the board explains";
    else if (is_focal && std::abs(thing.asked) > foreign * thing.value)
      check.text += ": the file of another camera, or zoomed";
    else
      check.text += ": calibrate the camera again";
    if (may_bend && !is_bent) check.text += "; a board that is not flat looks alike";
  }
  verdict.checks.push_back(std::move(check));
}

/// Distortion that the file gave without σ and that was estimated: is it the file's?
void add_freed_distortion(const RangefinderReport& report, Verdict& verdict) {
  constexpr double ask_beyond = 4.5;
  if (report.freed_distortion.empty()) return;
  Check check = check_of("distortion", State::good, "", 0.0, ask_beyond, "σ", "residuals");
  for (const FreedDistortion& one : report.freed_distortion) {
    const double z = std::abs(one.value - one.was) / one.sigma;
    if (!(z > check.value)) continue;
    check.value = z;
    if (z > ask_beyond) check.state = State::care;
    check.text = (one.name.starts_with("p") ? "the camera's tangential distortion " : "") + one.name + " is " +
                 text_of(one.value, 3) + " ± " + text_of(3.0 * one.sigma, 2) + " (3σ), not " + text_of(one.was, 3) +
                 " as in the camera file, which gives it without σ: calibrate the camera again";
  }
  if (check.state == State::good)
    check.text = "the camera file gives its distortion without σ: it is estimated too, and agrees with the file";
  verdict.checks.push_back(std::move(check));
}

/// Causes that few shots tell apart: of these the one that explains most is named.
bool is_alike(const ShotCause& cause) {
  return cause.name == "bend" || cause.name == "incidence" || cause.name == "sheet";
}

/// What of the cause, of that size, a user would see.
std::string said_of(const ShotCause& cause) {
  const std::string size =
      cause.unit == "m" ? text_of(1e3 * cause.size, 2) + " mm" : text_of(cause.size, 2) + " " + cause.unit;
  const std::string by = " (" + text_of(cause.sigmas, 2) + "σ)";
  if (cause.name == "drift")
    return "the readings drift by " + size + " from the first row to the last" + by +
           ": let the rangefinder warm up, or something was moved";
  if (cause.name == "bend")
    return "the readings curve over their range, by " + size + " at its ends" + by +
           ": the rangefinder is not linear, or the board or the lens is not as given";
  if (cause.name == "incidence")
    return "the readings depend on the angle of incidence, by " + size + " at 45°" + by +
           ": of a spot that is long on a tilted board; tilt boards less, or by the same as what is measured later";
  if (cause.name == "sheet")
    return "the beam meets a surface that lies " + size + " off the plane of the corners" + by +
           ", as of a sheet before the print: let it meet the print";
  return "the spots wander by " + size + " from the first row to the last" + by +
         ": the rangefinder, or the camera's lens, was moved";
}

/// What else explains nearly as much as the cause does.
std::string alike(const ShotCause& cause, const std::vector<ShotCause>& causes) {
  constexpr double told_apart = 2.5;  // σ, of the difference of χ²
  std::string others;
  for (const ShotCause& other : causes) {
    if (!is_alike(other) || other.name == cause.name) continue;
    if (cause.sigmas * cause.sigmas - other.sigmas * other.sigmas > told_apart * told_apart) continue;
    others += (others.empty() ? "" : " and ");
    others += other.name == "bend"        ? "readings that curve over their range"
              : other.name == "incidence" ? "readings that depend on incidence"
                                          : "a sheet before the print";
  }
  return others.empty() ? "" : "; " + others + " cannot be distinguished from it here";
}

/// What the errors of all shots share.
void add_shared_errors(const RangefinderReport& report, Verdict& verdict) {
  constexpr double ask_beyond = 3.5;
  double most = 0.0;
  for (const ShotCause& cause : report.causes)
    if (is_alike(cause)) most = std::max(most, cause.sigmas);
  for (const ShotCause& cause : report.causes) {
    if (cause.name == "bent") continue;
    Check check = check_of(cause.name, State::good, "no " + cause.name + " of the shots is indicated", cause.sigmas,
                           ask_beyond, "σ", "residuals");
    if (cause.sigmas >= ask_beyond && is_alike(cause) && cause.sigmas < most) {
      check.text = "another cause explains more than " + cause.name + " (" + text_of(cause.sigmas, 2) + "σ) would";
    } else if (cause.sigmas < ask_beyond && cause.name == "sheet" && report.sheet.left_m > 0.0) {
      check.text = "no sheet before the print is indicated; " + text_of(1e3 * report.sheet.left_m, 2) +
                   " mm of one, which the shots leave open, are counted in σ";
    } else if (cause.sigmas >= ask_beyond) {
      check.state = State::care;
      check.text = said_of(cause) + (is_alike(cause) ? alike(cause, report.causes) : "");
    }
    verdict.checks.push_back(std::move(check));
  }
}

/// σ that were told and overruled.
void add_overruled(const RangefinderReport& report, Verdict& verdict) {
  for (const OverruledSigma& one : report.overruled_sigmas) {
    const bool is_range = one.name == "sigma_range_m";
    const double unit = is_range ? 1e3 : 1.0, times = one.found / one.told;
    verdict.checks.push_back(
        check_of("noise told", State::care,
                 (is_range ? "the readings scatter by " : "the spots scatter by ") + text_of(unit * one.found, 2) +
                     (is_range ? " mm, " : " px, ") + text_of(times, 2) + " times " +
                     (is_range ? "--sigma-range-m" : "--sigma-px") + ": what they scatter by was used; tell so",
                 times, 1.0, "", "residuals"));
  }
}

/// Spots alone have no left and right: with u and v exchanged another beam fits them as well. A rangefinder looks along
/// with its camera: of two such beams the one that does is the likelier.
void add_exchanged(const RangefinderReport& report, const RangefinderConfig& config, Verdict& verdict) {
  constexpr double aside_rad = 0.07, likelier = 0.4;
  if (config.method != RangefinderMethod::spot) return;
  const auto far_px = project(report.camera, report.beam.direction_in_cam);
  const auto other = far_px ? unproject(report.camera, far_px->reverse()) : std::nullopt;
  if (!other) return;
  const double given_rad = std::acos(std::clamp(report.beam.direction_in_cam.z(), -1.0, 1.0));
  const double other_rad = std::acos(std::clamp(other->normalized().z(), -1.0, 1.0));
  const bool is_likelier = given_rad > aside_rad && other_rad < likelier * given_rad;
  verdict.checks.push_back(check_of("columns", is_likelier ? State::care : State::good,
                                    is_likelier ? "the beam points " + text_of(given_rad / degree, 2) +
                                                      "° away from where the camera looks; with u "
                                                      "and v exchanged " +
                                                      text_of(other_rad / degree, 2) + "°: are these columns exchanged?"
                                                : "u and v stand in their order, as far as the beam's direction shows",
                                    given_rad / degree, aside_rad / degree, "°", ""));
}

/// Spots that the camera cannot have seen.
void add_outside(const RangefinderReport& report, std::span<const Shot> shots, Verdict& verdict) {
  int num = 0;
  for (std::size_t i = 0; i < shots.size() && i < report.shots.size(); ++i)
    num += shots[i].spot && !may_be_in_image(report.camera, shots[i].spot->px) ? 1 : 0;
  if (num == 0) return;
  verdict.checks.push_back(check_of("spots outside", State::care,
                                    std::to_string(num) + (num == 1 ? " spot lies" : " spots lie") +
                                        " outside the image: are u and v exchanged, or is it another camera's file?",
                                    num, 0.0, "", ""));
}

/// How much larger the first values are than the second, in σ of the sum of their ranks, which one wild value does not
/// move. H. B. Mann & D. R. Whitney, 1947.
double rank_sum_sigmas(const std::vector<double>& first, const std::vector<double>& second) {
  double wins = 0.0;
  for (const double a : first)
    for (const double b : second) wins += a > b ? 1.0 : 0.0;
  const auto n = static_cast<double>(first.size()), m = static_cast<double>(second.size());
  return (wins - 0.5 * n * m) / std::sqrt(n * m * (n + m + 1.0) / 12.0);
}

/// Near and far spots, in their σ: where the one half scatters more than the other, σ hangs on distance.
void add_by_distance(const RangefinderReport& report, std::span<const Shot> shots, Verdict& verdict) {
  constexpr double ask_beyond = 3.2;
  constexpr std::size_t enough = 8;
  std::vector<std::pair<double, double>> spots;  // range, residual in its σ
  for (std::size_t i = 0; i < report.shots.size() && i < shots.size(); ++i) {
    const ShotFit& fit = report.shots[i];
    if (!fit.used || !fit.residual_px.allFinite()) continue;
    spots.emplace_back(shots[i].range_m, std::sqrt(squared_mahalanobis(fit.residual_px, fit.cov_px)));
  }
  if (spots.size() < 2 * enough) return;
  std::sort(spots.begin(), spots.end());
  std::vector<double> near, far;
  for (std::size_t i = 0; i < spots.size(); ++i) (i < spots.size() / 2 ? near : far).push_back(spots[i].second);
  const double z = rank_sum_sigmas(near, far);
  const bool differs = std::abs(z) > ask_beyond;
  const double ratio = median_of(near) / median_of(far);
  verdict.checks.push_back(check_of("spots by distance", differs ? State::care : State::good,
                                    differs ? "spots of the " + std::string(z > 0.0 ? "near" : "far") +
                                                  " shots scatter " + text_of(z > 0.0 ? ratio : 1.0 / ratio, 2) +
                                                  " times as much as the others: give each its sigma_px"
                                            : "near and far spots scatter alike",
                                    std::abs(z), ask_beyond, "σ", "residuals"));
}

/// A rangefinder that scatters by decimetres is none, or its readings are of something else.
void add_range_noise(const RangefinderReport& report, Verdict& verdict) {
  constexpr double max_m = 0.1;
  if (!report.range_sigma_is_estimated || report.shots_used == 0) return;
  const double sigma_m = report.beam.noise.sigma_m;
  verdict.checks.push_back(check_of("range noise", sigma_m < max_m ? State::good : State::refused,
                                    sigma_m < max_m ? "readings scatter by " + text_of(1e3 * sigma_m, 2) + " mm"
                                                    : "the readings scatter by " + text_of(1e3 * sigma_m, 2) +
                                                          " mm about what was seen: no beam explains them",
                                    1e3 * sigma_m, 1e3 * max_m, "mm", "residuals"));
}

}  // namespace

void add_cause_checks(const RangefinderReport& report, std::span<const Shot> shots, const RangefinderConfig& config,
                      Verdict& verdict) {
  add_overruled(report, verdict);
  add_scale(report, config, verdict);
  add_bent_board(report, verdict);
  add_camera(report, verdict);
  add_freed_distortion(report, verdict);
  add_shared_errors(report, verdict);
  add_exchanged(report, config, verdict);
  add_outside(report, shots, verdict);
  add_by_distance(report, shots, verdict);
  add_range_noise(report, verdict);
}

}  // namespace alidade
