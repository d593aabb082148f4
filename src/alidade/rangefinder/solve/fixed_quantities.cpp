#include "alidade/rangefinder/solve/fixed_quantities.h"

#include <algorithm>
#include <cmath>

#include "alidade/beam/unit_direction.h"
#include "alidade/rangefinder/solve/fixed_distortion.h"

namespace alidade {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// The first of a solve's parameters are those of the beam.
BeamVector of_beam(const VectorXd& all, const RangefinderReport& report) {
  BeamVector beam = BeamVector::Zero();
  const Index num = report.cov_model(beam_scale_param, beam_scale_param) > 0.0 ? 6 : 5;
  beam.head(num) = all.head(num);
  return beam;
}

/// A fixed quantity whose column in the system is `column`: its parameters move along `along` for a unit of it.
FixedQuantity fixed_along(const std::string& name, const VectorXd& along, const ReducedSystem& system,
                          const SolvedPart& part, const VectorXd& g, const RangefinderReport& report) {
  const VectorXd column = system.H * along;
  const VectorXd moves = -part.inverse * column(part.places);
  FixedQuantity thing{.name = name, .moves = of_beam(moves, report)};
  const double information = along.dot(column) + column(part.places).dot(moves);
  // Less than a ten-thousandth left by the others is rounding.
  if (!(information > 1e-9 * along.dot(column))) return thing;
  thing.asked = -(along.dot(g) + g(part.places).dot(moves)) / information;
  thing.asked_sigma = 1.0 / std::sqrt(information);
  return thing;
}

/// The lens was free within its covariance: what an error of its prior does, and how far the shots pulled it away.
FixedQuantity prior_along(const std::string& name, const VectorXd& along_lens, const SolvedPart& part,
                          const LensPrior& prior, const Camera& camera, const RangefinderReport& report) {
  const auto num_lens = static_cast<Index>(prior.free.size());
  VectorXd along(num_lens);
  VectorXd away(num_lens);
  const VectorXd now = params(report.camera.lens);
  for (Index i = 0; i < num_lens; ++i) {
    const int parameter = prior.free[static_cast<std::size_t>(i)];
    along[i] = parameter < along_lens.size() ? along_lens[parameter] : 0.0;
    away[i] = now[parameter] - prior.mean[parameter];
  }
  const VectorXd pulled = prior.information * along;
  FixedQuantity thing{.name = name, .moves = of_beam(part.inverse.rightCols(num_lens) * pulled, report)};
  const Eigen::MatrixXd cov_before = camera.cov(prior.free, prior.free);
  const Eigen::MatrixXd cov_after = part.inverse.bottomRightCorner(num_lens, num_lens);
  const VectorXd u = along / along.squaredNorm();  // the value of `along` in the lens' parameters
  const double before = u.dot(cov_before * u), after = u.dot(cov_after * u);
  thing.sigma = std::sqrt(before);
  // Of an error of the prior the shots take this share. Less than a thousandth says nothing of it.
  const double share = (before - after) / before;
  if (!(share > 1e-3)) return thing;
  thing.asked = u.dot(away) / share;
  thing.asked_sigma = *thing.sigma / std::sqrt(share);
  return thing;
}

/// Lens parameters for a pixel of: the focal length fx (fy with it), the centre.
std::vector<std::pair<std::string, VectorXd>> lens_things(const Camera& camera) {
  const VectorXd values = params(camera.lens);
  VectorXd f = VectorXd::Zero(4), cx = f, cy = f;
  f.head<2>() = values.head<2>() / values[0];
  cx[2] = cy[3] = 1.0;
  return {{"camera.f", f}, {"camera.cx", cx}, {"camera.cy", cy}};
}

/// Refine::beam carries the lens' covariance; where it is known it is counted.
std::optional<double> carried_sigma(const Camera& camera, const VectorXd& along_lens) {
  if (camera.cov.rows() < 4 || !camera.cov.allFinite()) return std::nullopt;
  const VectorXd u = along_lens / along_lens.squaredNorm();
  return std::sqrt(u.dot(camera.cov.topLeftCorner(4, 4) * u));
}

/// Distortion that was free within its covariance.
void add_free_distortion(const SolvedPart& part, const LensPrior& prior, const Camera& camera,
                         const RangefinderReport& report, std::vector<FixedQuantity>& fixed) {
  const VectorXd values = params(camera.lens);
  const std::vector<std::string> names = param_names(camera.lens);
  for (const int parameter : prior.free) {
    const std::string& name = names[static_cast<std::size_t>(parameter)];
    if (!name.starts_with('k') && !name.starts_with('p')) continue;
    fixed.push_back(
        prior_along("camera." + name, VectorXd::Unit(values.size(), parameter), part, prior, camera, report));
    fixed.back().value = values[parameter];
  }
}

/// Distortion that is fixed, and of which the file says no σ.
void add_distortion(const ReducedSystem& system, const SolvedPart& part, const LensPrior& prior, const Camera& camera,
                    const VectorXd& g, const RangefinderReport& report, std::vector<FixedQuantity>& fixed) {
  const Camera wide = with_distortion(camera);
  const VectorXd values = params(with_distortion(report.camera).lens);
  const std::vector<std::string> names = param_names(wide.lens);
  for (const int parameter : fixed_distortion(wide, prior.free)) {
    const std::string& name = names[static_cast<std::size_t>(parameter)];
    const VectorXd along = VectorXd::Unit(system.H.rows(), system.of_lens(parameter));
    fixed.push_back(fixed_along("camera." + name, along, system, part, g, report));
    fixed.back().value = values[parameter];
    // Refine::beam carries the covariance of the whole lens.
    const bool has_sigma = parameter < wide.cov.rows() && wide.cov(parameter, parameter) > 0.0;
    if (has_sigma) fixed.back().sigma = std::sqrt(wide.cov(parameter, parameter));
  }
}

void add_lens(const ReducedSystem& system, const SolvedPart& part, const LensPrior& prior, const Camera& camera,
              const VectorXd& g, const RangefinderReport& report, std::vector<FixedQuantity>& fixed) {
  const VectorXd values = params(camera.lens);
  for (const auto& [name, along_lens] : lens_things(camera)) {
    if (!prior.free.empty()) {
      fixed.push_back(prior_along(name, along_lens, part, prior, camera, report));
    } else {
      VectorXd along = VectorXd::Zero(system.H.rows());
      along.segment(num_beam_params, 4) = along_lens;
      fixed.push_back(fixed_along(name, along, system, part, g, report));
      fixed.back().sigma = carried_sigma(camera, along_lens);
    }
    fixed.back().value = values[name == "camera.f" ? 0 : name == "camera.cx" ? 2 : 3];
  }
  add_free_distortion(part, prior, camera, report, fixed);
  add_distortion(system, part, prior, camera, g, report, fixed);
}

BeamVector between(const Beam& from, const Beam& to) {
  BeamVector away;
  away << to.origin_in_cam - from.origin_in_cam, tangent_basis(from.direction_in_cam).transpose() * to.direction_in_cam,
      to.scale - from.scale;
  return away;
}

}  // namespace

VectorXd gradient_of(const ReducedSystem& system, const LensPrior& prior, const Camera& camera) {
  VectorXd g = VectorXd::Zero(system.H.rows());
  for (const ReducedShot& shot : system.shots) g += shot.g;
  if (prior.free.empty()) return g;
  g(system.places(0, prior.free)) += prior.information * (params(camera.lens) - prior.mean)(prior.free);
  return g;
}

std::vector<FixedQuantity> fixed_quantities(const ReducedSystem& system, const SolvedPart& part, const LensPrior& prior,
                                            const Camera& camera, std::span<const Eigen::Vector3d> points_in_board,
                                            const RangefinderReport& report, const RangefinderConfig& config) {
  std::vector<FixedQuantity> fixed;
  const VectorXd g = gradient_of(system, prior, report.camera);
  const bool has_boards =
      config.method != RangefinderMethod::spot && points_in_board.size() > 1 &&
      std::any_of(system.shots.begin(), system.shots.end(), [](const ReducedShot& shot) { return shot.has_corners; });
  if (has_boards) {
    const double square_m = (points_in_board[1] - points_in_board[0]).norm();
    const VectorXd column = system.square_column(report.beam) / square_m;
    fixed.push_back(
        {.name = "square_m", .value = square_m, .moves = of_beam(-part.inverse * column(part.places), report)});
    fixed.back().sigma = config.sigma_square_m;
    // A board that is hit so far before the plane of its corners: the beam starts so much nearer.
    fixed.push_back({.name = "board.flat_m", .value = 0.0, .sigma = config.sigma_flat_m});
    fixed.back().moves.head<3>() = report.beam.direction_in_cam;
  }
  if (!config.estimate_scale) {
    fixed.push_back(fixed_along("scale", VectorXd::Unit(system.H.rows(), beam_scale_param), system, part, g, report));
    fixed.back().value = report.beam.scale;
    fixed.back().sigma = config.sigma_scale;
  }
  add_lens(system, part, prior, camera, g, report, fixed);
  return fixed;
}

std::vector<FixedQuantity> fixed_sigmas(const BeamProblem& problem, const RangefinderReport& report) {
  constexpr double part = 0.2;
  std::vector<FixedQuantity> fixed;
  const auto here = solve_beam(problem, report.camera, report.beam);
  if (!here) return fixed;
  const double dof = std::max(1, here->normals.num_rows - problem.num_free());
  const auto add = [&](const char* name, double value, bool is_given, const BeamProblem& other) {
    const auto there = solve_beam(other, report.camera, report.beam);
    if (!(value > 0.0) || !there || !there->converged) return;
    fixed.push_back({.name = name, .value = value, .moves = between(here->beam, there->beam) / (part * value)});
    if (is_given) fixed.back().sigma = value / std::sqrt(2.0 * dof);
  };
  BeamProblem other = problem;
  RangeNoise& noise = other.model.noise;
  noise = {noise.sigma_m * (1.0 + part), noise.per_m * (1.0 + part), noise.incidence_m * (1.0 + part)};
  for (PreparedShot& shot : other.shots)
    if (shot.sigma_range_m) *shot.sigma_range_m *= 1.0 + part;
  add("sigma_range_m", problem.model.noise.sigma_m, report.range_sigma_is_estimated, other);
  other = problem;
  bool has_spots = false;
  for (PreparedShot& shot : other.shots) {
    has_spots = has_spots || (shot.used && shot.spot_px);
    shot.sigma_spot_px *= 1.0 + part;
  }
  if (has_spots) add("sigma_spot_px", report.sigma_spot_px, report.spot_sigma_is_estimated, other);
  return fixed;
}

}  // namespace alidade
