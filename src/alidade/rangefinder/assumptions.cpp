#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/rangefinder/rangefinder.h"

namespace alidade {
namespace {

/// What is ordinarily wrong with a thing that nobody gave a σ for, in its unit.
double ordinary_error(const HeldThing& thing) {
  if (thing.name == "square_m") return 0.002 * thing.value;  // a printer
  if (thing.name == "scale") return 0.005;
  if (thing.name == "camera.f") return 0.003 * thing.value;
  if (thing.name.starts_with("camera")) return 2.0;
  if (thing.name == "board.flat_m") return 0.0003;
  return 0.2 * thing.value;  // a σ
}

const char* remedy_of(const std::string& name) {
  if (name == "square_m")
    return "measure the squares and give --sigma-square, or estimate the readings' scale: --scale";
  if (name == "scale") return "give --sigma-scale, or estimate it: --scale";
  if (name.starts_with("camera")) return "use a camera file with covariance: alidade calibrate";
  if (name == "board.flat_m") return "glue the board to something flat";
  return "leave it out: the residuals tell it";
}

/// Writes which value it moves most, in that value's σ, for an error of the thing.
void put_moves(const RangefinderReport& report, const BeamVector& moves, Assumption& assumption) {
  static constexpr std::array<const char*, 7> names{"origin_m x",  "origin_m y",  "origin_m z", "direction x",
                                                    "direction y", "direction z", "scale"};
  const Beam moved = report.beam.retract(1e-6 * moves);  // the step of a sphere, straightened
  Eigen::Vector<double, 7> change;
  change << moves.head<3>(), 1e6 * (moved.direction_in_cam - report.beam.direction_in_cam), moves[5];
  const Eigen::Matrix<double, 7, 7> cov = embedded_covariance(report.beam);
  for (Eigen::Index i = 0; i < 7; ++i) {
    const bool is_result = i != 5 && (i != 6 || !report.scale_by_need);  // z of a direction hangs on its x and y
    if (!is_result || !(cov(i, i) > 0.0)) continue;
    const double in_sigmas = std::abs(change[i]) / std::sqrt(cov(i, i));
    if (!(in_sigmas > assumption.moves)) continue;
    assumption.moves = in_sigmas;
    assumption.moved = names[static_cast<std::size_t>(i)];
    assumption.moved_by = change[i];
  }
}

bool is_of_lengths(const HeldThing& thing) { return thing.name == "scale" || thing.name == "square_m"; }

Assumption assumption_of(const RangefinderReport& report, const HeldThing& thing) {
  Assumption assumption{.name = thing.name, .value = thing.value, .sigma = thing.sigma};
  if (!thing.sigma) assumption.ordinary = ordinary_error(thing);
  assumption.remedy = thing.sigma ? "" : remedy_of(thing.name);
  put_moves(report, thing.sigma.value_or(assumption.ordinary) * thing.moves, assumption);
  return assumption;
}

}  // namespace

std::vector<Assumption> rangefinder_assumptions(const RangefinderReport& report) {
  std::vector<Assumption> assumed;
  for (const HeldThing& thing : report.held) assumed.push_back(assumption_of(report, thing));
  return assumed;
}

bool wants_scale(const RangefinderReport& report, const RangefinderConfig& config) {
  constexpr double asks_beyond = 3.0;
  if (config.estimate_scale || config.sigma_scale || config.method == RangefinderMethod::spot) return false;
  if (std::abs(report.scale_in_sigmas) > asks_beyond) return true;
  return std::any_of(report.held.begin(), report.held.end(), [&](const HeldThing& thing) {
    return is_of_lengths(thing) && !thing.sigma && assumption_of(report, thing).moves > 1.0;
  });
}

}  // namespace alidade
