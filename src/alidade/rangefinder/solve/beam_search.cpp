#include "alidade/rangefinder/solve/beam_search.h"
#include "alidade/estimation/median.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <utility>

#include "alidade/beam/unit_direction.h"
#include "alidade/rangefinder/solve/beam_bound.h"
#include "alidade/rangefinder/solve/beam_start.h"

namespace alidade {
namespace {

using Sample = std::vector<const PreparedShot*>;
constexpr double plausible_origin_m = 0.5;  // a rangefinder beside a camera: decides between beams that fit alike
constexpr double as_good = 9.0;             // 3σ of one parameter

double focal_of(const Camera& camera) { return params(camera.lens)[0]; }

std::vector<Beam> starts_of(const Sample& sample, const BeamProblem& problem, const Camera& camera) {
  Sample with_spot, with_plane;
  for (const PreparedShot* shot : sample) {
    if (shot->spot_px) with_spot.push_back(shot);
    if (shot->plane) with_plane.push_back(shot);
  }
  std::vector<Beam> starts;
  if (!with_plane.empty() && (!with_spot.empty() || problem.estimate_scale)) {
    if (const auto start = joint_start(sample, problem.model, focal_of(camera), problem.estimate_scale))
      starts.push_back(*start);
  }
  if (with_spot.size() >= 3 && (with_plane.empty() || starts.empty())) {
    if (const auto start = spot_start(with_spot)) starts.push_back(*start);
  }
  if (with_plane.size() >= 5 && (with_spot.empty() || starts.empty())) {
    for (const Beam& start : plane_starts(with_plane)) starts.push_back(start);
  }
  return starts;
}

Sample used_shots(const BeamProblem& problem) {
  Sample used;
  for (const PreparedShot& shot : problem.shots)
    if (shot.used && shot.num_rows() > 0) used.push_back(&shot);
  return used;
}

double rank_of(const BeamSolution& solution) {
  return solution.normals.cost + (solution.beam.origin_in_cam.norm() > plausible_origin_m ? as_good : 0.0) +
         (solution.converged ? 0.0 : as_good);
}

/// Another beam, not a point in the same minimum: more than 1σ of the best one away, what its covariance does not
/// cover.
bool is_another(const BeamSolution& best, const Beam& beam) {
  BeamVector away = BeamVector::Zero();
  away.head<3>() = beam.origin_in_cam - best.beam.origin_in_cam;
  away.segment<2>(3) = tangent_basis(best.beam.direction_in_cam).transpose() * beam.direction_in_cam;
  away[5] = beam.scale - best.beam.scale;
  return away.dot(best.normals.H * away) > 1.0;
}

/// One shot out of each of `size` classes of range: spread samples determine most.
Sample draw_sample(const Sample& by_range, std::size_t size, std::mt19937_64& bits) {
  Sample sample;
  for (std::size_t k = 0; k < size; ++k) {
    const std::size_t from = k * by_range.size() / size, to = (k + 1) * by_range.size() / size;
    sample.push_back(by_range[from + static_cast<std::size_t>(bits() % (to - from))]);
  }
  return sample;
}

/// Squared residuals of all shots at a beam, the scale they are measured by, and what they add up to, truncated.
struct Agreement {
  std::vector<double> chi2;
  double scale2 = 1.0;
  double score = std::numeric_limits<double>::infinity();
  int num_agreeing = 0;
};

Agreement agreement_of(const Sample& shots, const Beam& beam, const Camera& camera, const ShotModel& model,
                       const OutlierSearch& search) {
  Agreement found;
  double num_rows = 0.0;
  for (const PreparedShot* shot : shots) {
    found.chi2.push_back(shot_chi2(*shot, beam, camera, model));
    num_rows += shot->num_rows();
  }
  const double limit = search.sigmas * search.sigmas;
  if (!search.knows_sigma) {
    // Median of χ² by Wilson & Hilferty's cube root.
    const double rows = num_rows / static_cast<double>(shots.size());
    found.scale2 = median_of(found.chi2) / (rows * std::pow(1.0 - 2.0 / (9.0 * rows), 3));
    if (!std::isfinite(found.scale2)) return found;
    found.scale2 = std::max({found.scale2, search.min_scale2, 1e-12});
  }
  found.score = search.knows_sigma ? 0.0 : found.scale2;
  for (const double chi2 : found.chi2) {
    if (search.knows_sigma) found.score += std::min(chi2, limit);
    if (chi2 < limit * found.scale2) ++found.num_agreeing;
  }
  return found;
}

/// A sample's beam, and who agrees with it.
struct Candidate {
  Beam beam;
  Agreement agreement;
};

/// Of the shots those that agree are used, the others not; how many are.
int use_agreeing(const Sample& shots, const Agreement& agreement, const OutlierSearch& search, BeamProblem& problem) {
  int num = 0;
  for (PreparedShot& shot : problem.shots) shot.used = false;
  for (std::size_t i = 0; i < shots.size(); ++i) {
    if (!(agreement.chi2[i] < search.sigmas * search.sigmas * agreement.scale2)) continue;
    const auto at = std::ranges::find(problem.shots, shots[i]->index, &PreparedShot::index);
    at->used = true;
    ++num;
  }
  return num;
}

/// The beam of those that agree; twice, as they change with it. `work`: a copy of the problem, to mark shots in.
Beam refined_on_agreeing(const Sample& shots, Beam beam, Agreement& agreement, const Camera& camera,
                         const OutlierSearch& search, BeamProblem& work) {
  for (int pass = 0; pass < 3; ++pass) {
    use_agreeing(shots, agreement, search, work);
    const auto solved = solve_beam(work, camera, beam);
    if (!solved) break;
    Agreement better = agreement_of(shots, solved->beam, camera, work.model, search);
    if (!(better.score < agreement.score)) break;
    beam = solved->beam;
    agreement = std::move(better);
  }
  return beam;
}

/// Where σ is not known, the least median of many samples is too small a scale. From those within 6 of it outwards:
/// beam and scale of those that agree, then all that agree with these, until no more do.
Beam grown(const Sample& shots, Beam beam, Agreement& agreement, const Camera& camera, const OutlierSearch& search,
           BeamProblem& work) {
  const double spare = std::max(1.0, static_cast<double>(shots.size()) - work.num_free());
  agreement.scale2 *= std::pow(1.0 + 5.0 / spare, 2);  // P. J. Rousseeuw & A. M. Leroy, 1987, on small samples
  for (int pass = 0, before = 0; pass < 20; ++pass) {
    const int now = use_agreeing(shots, agreement, search, work);
    const auto solved = now > before ? solve_beam(work, camera, beam) : std::nullopt;
    if (!solved) break;
    before = now;
    beam = solved->beam;
    const double dof = solved->normals.num_rows - work.num_free();
    const double scale2 = std::max(agreement.scale2, solved->normals.cost / std::max(1.0, dof));
    agreement = agreement_of(shots, beam, camera, work.model, search);
    agreement.scale2 = scale2;
  }
  return beam;
}

}  // namespace

std::optional<BeamFit> best_beam(const BeamProblem& problem, const Camera& camera,
                                 const std::optional<Beam>& also_from) {
  std::vector<Beam> starts = starts_of(used_shots(problem), problem, camera);
  if (also_from) starts.push_back(*also_from);
  std::vector<BeamSolution> solutions;
  for (const Beam& start : starts) {
    auto solution = solve_beam(problem, camera, start);
    if (solution) solutions.push_back(std::move(*solution));
  }
  if (solutions.empty()) return std::nullopt;
  std::stable_sort(solutions.begin(), solutions.end(),
                   [](const auto& a, const auto& b) { return rank_of(a) < rank_of(b); });
  BeamFit fit{solutions[0], {}};
  for (std::size_t i = 1; i < solutions.size(); ++i) {
    const bool fits = rank_of(solutions[i]) < rank_of(solutions[0]) + as_good && solutions[i].converged;
    if (fits && is_another(solutions[0], solutions[i].beam)) fit.alternatives.push_back(solutions[i].beam);
  }
  return fit;
}

std::size_t sample_size(const BeamProblem& problem) {
  const Sample used = used_shots(problem);
  const auto count = [&](auto has) { return std::count_if(used.begin(), used.end(), has); };
  const bool has_planes = count([](const PreparedShot* shot) { return shot->plane.has_value(); }) > 0;
  const bool has_spots = count([](const PreparedShot* shot) { return shot->spot_px.has_value(); }) > 0;
  const auto num_both = count([](const PreparedShot* shot) { return shot->plane && shot->spot_px; });
  if (!has_planes) return 4;
  if (!has_spots) return problem.estimate_scale ? 6 : 5;
  return num_both == static_cast<std::ptrdiff_t>(used.size()) ? 3 : 5;
}

std::optional<Beam> find_outliers(BeamProblem& problem, const Camera& camera, const OutlierSearch& search) {
  Sample shots = used_shots(problem);
  std::stable_sort(shots.begin(), shots.end(),
                   [](const PreparedShot* a, const PreparedShot* b) { return a->range_m < b->range_m; });
  const std::size_t size = sample_size(problem);
  if (shots.size() < size) return std::nullopt;
  std::mt19937_64 bits(search.seed);
  std::vector<Candidate> candidates;
  for (int draw = 0; draw < search.num_draws; ++draw) {
    for (const Beam& beam : starts_of(draw_sample(shots, size, bits), problem, camera)) {
      Candidate candidate{beam, agreement_of(shots, beam, camera, problem.model, search)};
      if (std::isfinite(candidate.agreement.score)) candidates.push_back(std::move(candidate));
    }
  }
  // Local optimisation of the most promising only: O. Chum et al., "Locally Optimized RANSAC", 2003.
  constexpr std::size_t max_refined = 12;
  std::ranges::stable_sort(candidates, {}, [](const Candidate& candidate) { return candidate.agreement.score; });
  if (candidates.size() > max_refined) candidates.resize(max_refined);
  BeamProblem work = problem;
  std::optional<Beam> best;
  Agreement best_agreement;
  for (Candidate& candidate : candidates) {
    const Beam beam = refined_on_agreeing(shots, candidate.beam, candidate.agreement, camera, search, work);
    if (!(candidate.agreement.score < best_agreement.score)) continue;
    best = beam;
    best_agreement = std::move(candidate.agreement);
  }
  if (!best) return std::nullopt;
  if (!search.knows_sigma) best = grown(shots, *best, best_agreement, camera, search, work);
  std::vector<std::size_t> wrong;
  for (std::size_t i = 0; i < shots.size(); ++i)
    if (!(best_agreement.chi2[i] < search.sigmas * search.sigmas * best_agreement.scale2))
      wrong.push_back(shots[i]->index);
  for (PreparedShot& shot : problem.shots)
    if (std::find(wrong.begin(), wrong.end(), shot.index) != wrong.end()) shot.used = false;
  return best;
}

bool looks_wrong(const BeamProblem& problem, const Camera& camera, const BeamSolution& solution) {
  if (!solution.converged) return true;
  const double dof = std::max(1, solution.normals.num_rows - problem.num_free());
  if (!(solution.normals.cost < dof + 5.0 * std::sqrt(2.0 * dof))) return true;
  const Sample used = used_shots(problem);
  return std::any_of(used.begin(), used.end(), [&](const PreparedShot* shot) {
    return !(shot_chi2(*shot, solution.beam, camera, problem.model) < 25.0);
  });
}

double scale_in_sigmas(const BeamProblem& problem, const Camera& camera, const Beam& beam, bool sigma_is_estimated,
                       double min_sigma_m) {
  BeamProblem work = problem;
  work.estimate_scale = true;
  const auto planes = std::count_if(work.shots.begin(), work.shots.end(),
                                    [](const PreparedShot& shot) { return shot.used && shot.plane; });
  if (problem.estimate_scale || planes < 4) return 0.0;
  auto with = solve_beam(work, camera, beam);
  for (int round = 0; round < 6 && with && sigma_is_estimated; ++round) {
    const double change = estimate_noise(work, camera, with->beam, false, true);
    work.model.noise.sigma_m = std::max(work.model.noise.sigma_m, min_sigma_m);
    with = solve_beam(work, camera, with->beam);
    if (change < 1e-2) break;
  }
  constexpr int enough = 3;
  const int spare = with ? with->normals.num_rows - num_beam_params : 0;
  if (spare < enough || !with->converged) return 0.0;
  const double left = std::max(1.0, with->normals.cost / spare);
  const double sigma = std::sqrt(left * inverse_of_scaled(with->normals.H)(beam_scale_param, beam_scale_param));
  const double z = (with->beam.scale - 1.0) / sigma;
  return std::isfinite(z) ? z : 0.0;
}

}  // namespace alidade
