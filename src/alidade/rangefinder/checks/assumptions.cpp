#include <algorithm>
#include <cmath>
#include <string>

#include "alidade/rangefinder/rangefinder.h"
#include "alidade/rangefinder/solve/refine_all.h"

namespace alidade {
namespace {

/// What is ordinarily wrong with a thing that nobody gave a σ for, in its unit.
double ordinary_error(const FixedQuantity& thing) {
  if (thing.name == "square_m") return 0.002 * thing.value;  // a printer
  if (thing.name == "scale") return 0.005;
  if (thing.name == "camera.f") return 0.003 * thing.value;
  if (thing.name.starts_with("camera.c")) return 2.0;
  if (thing.name.starts_with("camera.k")) return 0.01;
  if (thing.name.starts_with("camera.p")) return 0.0003;
  if (thing.name == "board.flat_m") return 0.0003;
  return 0.2 * thing.value;  // a σ
}

const char* remedy_of(const RangefinderReport& report, const std::string& name) {
  const bool scale_is_free = std::ranges::count(report.fixed, "scale", &FixedQuantity::name) == 0;
  if (name == "square_m" && scale_is_free) return "measure the squares and give --sigma-square";
  if (name == "square_m")
    return "measure the squares and give --sigma-square, or estimate the readings' scale: --scale";
  if (name == "scale") return "give --sigma-scale, or estimate it: --scale";
  if (name.starts_with("camera")) return "use a camera file with covariance: alidade calibrate";
  if (name == "board.flat_m")
    return "glue the board to something flat, let the spot fall on the print, and give --sigma-flat";
  return "leave the option away: it is estimated from the residuals";
}

/// The move of one of the answer's vectors in its σ, √trace, as the verdict states it; named by what moves most.
void put_move_of(const std::string& name, const Eigen::Ref<const Eigen::VectorXd>& change, double sigma,
                 Assumption& assumption) {
  if (!(sigma > 0.0) || !(change.norm() / sigma > assumption.moves)) return;
  Eigen::Index most = 0;
  assumption.moves = change.norm() / sigma;
  assumption.moved_by = change.cwiseAbs().maxCoeff(&most);
  assumption.moved = change.size() == 1 ? name : name + " " + "xyz"[most];
}

/// Which of origin, direction and scale it moves most for an error of the thing.
void put_moves(const RangefinderReport& report, const BeamMatrix& cov, const BeamVector& moves,
               Assumption& assumption) {
  const Beam moved = report.beam.retract(1e-6 * moves);  // the step of a sphere, straightened
  const Eigen::Vector3d turned = 1e6 * (moved.direction_in_cam - report.beam.direction_in_cam);
  put_move_of("origin_m", moves.head<3>(), std::sqrt(cov.topLeftCorner<3, 3>().trace()), assumption);
  put_move_of("direction", turned, std::sqrt(cov.block<2, 2>(beam_direction_param, beam_direction_param).trace()),
              assumption);
  if (!report.scale_by_need)
    put_move_of("scale", moves.tail<1>(), std::sqrt(cov(beam_scale_param, beam_scale_param)), assumption);
}

bool is_of_distortion(const FixedQuantity& thing) {
  return thing.name.starts_with("camera.k") || thing.name.starts_with("camera.p");
}

bool is_of_lengths(const FixedQuantity& thing) { return thing.name == "scale" || thing.name == "square_m"; }

/// `cov`: of the beam, against which it counts.
Assumption assumption_of(const RangefinderReport& report, const BeamMatrix& cov, const FixedQuantity& thing) {
  Assumption assumption{.name = thing.name, .value = thing.value, .sigma = thing.sigma};
  if (!thing.sigma) assumption.ordinary = ordinary_error(thing);
  assumption.remedy = thing.sigma ? "" : remedy_of(report, thing.name);
  put_moves(report, cov, thing.sigma.value_or(assumption.ordinary) * thing.moves, assumption);
  return assumption;
}

/// By how much an ordinary error of it moves the beam, in σ that the shots make: one that a sheet makes larger hides
/// nothing.
double moves_shots(const RangefinderReport& report, const FixedQuantity& thing) {
  return assumption_of(report, report.beam.cov - report.sheet.counted(), thing).moves;
}

}  // namespace

std::vector<Assumption> rangefinder_assumptions(const RangefinderReport& report) {
  std::vector<Assumption> assumed;
  for (const FixedQuantity& thing : report.fixed) assumed.push_back(assumption_of(report, report.beam.cov, thing));
  // With another order, or in a mirrored image, another beam fits spots as well; boards have a left and a right.
  const bool has_boards = std::ranges::any_of(report.shots, [](const ShotFit& fit) { return fit.plane || fit.pose; });
  if (!has_boards && !report.shots.empty())
    assumed.push_back(
        {.name = "spots are (u, v) of an image that is not mirrored", .value = std::nan(""), .sigma = 0.0});
  return assumed;
}

bool wants_distortion(const RangefinderReport& report, const Camera& camera, const RangefinderConfig& config) {
  constexpr double asks_beyond = 3.0;
  if (config.refine != Refine::all || !config.refine_distortion || lens_prior(camera, true).free.empty()) return false;
  const bool has_boards =
      std::any_of(report.shots.begin(), report.shots.end(), [](const ShotFit& fit) { return fit.pose.has_value(); });
  return has_boards && std::any_of(report.fixed.begin(), report.fixed.end(), [&](const FixedQuantity& thing) {
           if (!is_of_distortion(thing) || thing.sigma) return false;
           return std::abs(thing.asked) > asks_beyond * thing.asked_sigma || moves_shots(report, thing) > 1.0;
         });
}

bool wants_scale(const RangefinderReport& report, const RangefinderConfig& config) {
  constexpr double asks_beyond = 3.0;
  if (config.estimate_scale || config.sigma_scale || config.method == RangefinderMethod::spot) return false;
  if (std::abs(report.scale_in_sigmas) > asks_beyond) return true;
  return std::any_of(report.fixed.begin(), report.fixed.end(), [&](const FixedQuantity& thing) {
    return is_of_lengths(thing) && !thing.sigma && moves_shots(report, thing) > 1.0;
  });
}

}  // namespace alidade
