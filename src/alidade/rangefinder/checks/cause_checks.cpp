#include "alidade/rangefinder/checks/cause_checks.h"
#include "alidade/estimation/median.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "alidade/geometry/decompositions.h"

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

/// A scale that was estimated as nobody told it, and is not 1: the rangefinder's, or that of the board.
void add_found_scale(const RangefinderReport& report, Verdict& verdict) {
  constexpr double ask_beyond = 4.0, beyond_an_instrument = 0.05;
  const double away = report.beam.scale - 1.0, sigma = std::sqrt(report.beam.cov(beam_scale_param, beam_scale_param));
  const double z = std::abs(away) / sigma;
  Check check = check_of("scale", z < ask_beyond ? State::good : State::care, "the readings' scale is 1 within its σ",
                         z, ask_beyond, "σ", "residuals");
  if (z >= ask_beyond)
    check.text = "the readings are " + text_of(1.0 / report.beam.scale, 5) +
                 " times what the board says: the rangefinder's scale (then give --scale), the printed squares "
                 "(measure them), or the camera's focal length";
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

void add_scale(const RangefinderReport& report, const RangefinderConfig& config, Verdict& verdict) {
  if (config.scale_by_need) add_found_scale(report, verdict);
  const std::string unit = config.estimate_scale && !config.scale_by_need ? unit_of(report.beam.scale) : "";
  if (!unit.empty())
    verdict.checks.push_back(check_of("scale", State::care, "the ranges are " + unit + ", not metres",
                                      report.beam.scale, 1.0, "", "residuals"));
  constexpr double ask_beyond = 4.0;
  const double z = std::abs(report.scale_in_sigmas);
  if (z == 0.0) return;
  verdict.checks.push_back(check_of("scale", z < ask_beyond ? State::good : State::care,
                                    z < ask_beyond ? "no scale of the readings is asked for"
                                                   : "the readings ask for --scale (" + text_of(z, 2) + " σ)",
                                    z, ask_beyond, "σ", "residuals"));
}

/// Do boards and spots ask for another lens than the file's?
void add_camera(const RangefinderReport& report, Verdict& verdict) {
  constexpr double ask_beyond = 4.5, foreign = 0.02;
  Check check =
      check_of("camera", State::good, "boards and spots agree with the camera file", 0.0, ask_beyond, "σ", "residuals");
  for (const FixedQuantity& thing : report.fixed) {
    if (!thing.name.starts_with("camera")) continue;
    const double z = std::abs(thing.asked) / thing.asked_sigma;
    if (!(z > check.value)) continue;
    check.value = z;
    if (z < ask_beyond) continue;
    check.state = State::care;
    const bool is_focal = thing.name == "camera.f";
    check.text = std::string("the shots ask for ") +
                 (is_focal                    ? "a focal length of "
                  : thing.name == "camera.cx" ? "a centre cx of "
                                              : "a centre cy of ") +
                 text_of(thing.value + thing.asked, 5) + " px, not " + text_of(thing.value, 5) + " (" + text_of(z, 2) +
                 "σ): " +
                 (is_focal && std::abs(thing.asked) > foreign * thing.value ? "the file of another camera, or zoomed"
                                                                            : "calibrate the camera again");
  }
  verdict.checks.push_back(std::move(check));
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
  add_scale(report, config, verdict);
  add_camera(report, verdict);
  add_by_distance(report, shots, verdict);
  add_range_noise(report, verdict);
}

}  // namespace alidade
