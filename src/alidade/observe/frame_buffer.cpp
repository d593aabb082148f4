#include "alidade/observe/frame_buffer.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace alidade {

FrameBuffer::FrameBuffer(std::size_t num_points, std::size_t capacity)
    : num_points_(num_points), capacity_(capacity), generation_(num_points, 0) {
  frames_.reserve(capacity);
  px_.reserve(capacity * num_points);
  generations_.reserve(capacity * num_points);
}

void FrameBuffer::add(const RotationFrame& frame, std::span<const Eigen::Vector2d> px) {
  if (frames_.size() >= capacity_) thin();
  frames_.push_back(frame);
  frames_.back().px = {};
  for (std::size_t i = 0; i < num_points_; ++i) {
    px_.push_back(i < px.size() ? px[i] : Eigen::Vector2d::Constant(not_seen));
    generations_.push_back(generation_[i]);
  }
}

void FrameBuffer::renew_all() {
  for (int& generation : generation_) ++generation;
}

void FrameBuffer::clear() {
  frames_.clear();
  px_.clear();
  generations_.clear();
}

void FrameBuffer::erase_before(double t_s) {
  const auto first = std::find_if(frames_.begin(), frames_.end(), [&](const auto& frame) { return frame.t_s >= t_s; });
  const auto count = first - frames_.begin();
  const auto cells = count * static_cast<std::ptrdiff_t>(num_points_);
  frames_.erase(frames_.begin(), first);
  px_.erase(px_.begin(), px_.begin() + cells);
  generations_.erase(generations_.begin(), generations_.begin() + cells);
}

void FrameBuffer::thin() {
  const std::size_t kept = (frames_.size() + 1) / 2;
  for (std::size_t k = 0; k < kept; ++k) {
    frames_[k] = frames_[2 * k];
    for (std::size_t i = 0; i < num_points_; ++i) {
      px_[k * num_points_ + i] = px_[2 * k * num_points_ + i];
      generations_[k * num_points_ + i] = generations_[2 * k * num_points_ + i];
    }
  }
  frames_.resize(kept);
  px_.resize(kept * num_points_);
  generations_.resize(kept * num_points_);
}

namespace {

/// Observations and slots for points, one per generation that was seen. Bearings are zero.
RotationBundle bundle_of(const FrameBuffer& buffer, const AdjustConfig& config, std::vector<int>& bundle_point_of) {
  RotationBundle bundle;
  bundle.frames = buffer.frames();
  bundle_point_of.assign(buffer.num_points(), -1);
  std::vector<int> generation(buffer.num_points(), -1);
  for (std::size_t k = 0; k < buffer.size(); ++k) {
    for (std::size_t i = 0; i < buffer.num_points(); ++i) {
      if (!is_seen(buffer.px(k, i))) continue;
      if (generation[i] != buffer.generation(k, i)) {
        generation[i] = buffer.generation(k, i);
        bundle_point_of[i] = static_cast<int>(bundle.points.size());
        bundle.points.emplace_back();
      }
      bundle.observations.push_back({static_cast<int>(k), bundle_point_of[i], buffer.px(k, i)});
    }
    const double range_m = buffer.frames()[k].range_m;
    if (!config.with_depth || !(range_m > 0.0) || config.range_point >= buffer.num_points()) continue;
    if (is_seen(buffer.px(k, config.range_point))) {
      bundle.ranges.push_back({static_cast<int>(k), bundle_point_of[config.range_point], range_m});
    }
  }
  for (std::size_t i = 0; i < buffer.num_points(); ++i) {
    if (generation[i] != buffer.current_generation(i)) bundle_point_of[i] = -1;  // the current one was not seen yet
  }
  return bundle;
}

/// Initial bearings from each point's first pixel with `camera`; depths from ranges.
bool start_points(RotationBundle& bundle, const RotatingCamera& camera, bool with_depth) {
  std::vector<bool> started(bundle.points.size(), false);
  for (const BundleObservation& seen : bundle.observations) {
    const auto i = static_cast<std::size_t>(seen.point);
    if (started[i]) continue;
    const auto ray = RotationView(camera, bundle.frames[static_cast<std::size_t>(seen.frame)]).ray_in_start(seen.px);
    if (!ray) return false;
    bundle.points[i] = {rotation_to(*ray), Eigen::Vector2d::Zero(), with_depth ? 0.2 : 0.0};
    started[i] = true;
  }
  for (const BundleRange& range : bundle.ranges) {
    bundle.points[static_cast<std::size_t>(range.point)].inverse_depth = 1.0 / range.range_m;
  }
  return true;
}

/// Rejects observations beyond 6 σ, and all of a point if most of its are: it moves. Returns the number rejected.
std::size_t reject_far(RotationBundle& bundle, const BundleSolution& solution, double sigma_px) {
  const auto is_far = [&](std::size_t i) { return !(solution.residual_px[i] < 6.0 * sigma_px); };
  std::vector<int> far_minus_near(bundle.points.size(), 0);
  for (std::size_t i = 0; i < bundle.observations.size(); ++i) {
    far_minus_near[static_cast<std::size_t>(bundle.observations[i].point)] += is_far(i) ? 1 : -1;
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < bundle.observations.size(); ++i) {
    const BundleObservation& seen = bundle.observations[i];
    if (!is_far(i) && far_minus_near[static_cast<std::size_t>(seen.point)] <= 0) bundle.observations[kept++] = seen;
  }
  const std::size_t out = bundle.observations.size() - kept;
  bundle.observations.resize(kept);
  return out;
}

RotatingCamera with_focal(RotatingCamera camera, double focal) {
  camera.k.head<2>().setConstant(focal);
  return camera;
}

/// σ of a coordinate by least squares (not robust).
double sigma_by_squares(const BundleSolution& solution) {
  const double count = 2.0 * static_cast<double>(solution.residual_px.size());
  return solution.rms_px * std::sqrt(count / std::max(solution.dof, 1));
}

/// Outliers can prevent convergence even though the other pixels fit: the solution is then good enough to reject them.
bool most_fit(const BundleSolution& solution, double sigma_px) {
  constexpr double ordinary = 2.0;
  return robust_sigma(solution.residual_px, solution.dof) < ordinary * sigma_px;
}

/// Solves twice more from the solution so far: first without outliers, then with σ from the remaining residuals.
void solve_again(const AdjustConfig& config, const Progress& progress, RotationBundleConfig& solve,
                 Adjustment& adjustment) {
  RotationBundle& bundle = adjustment.bundle;
  const bool sigma_is_known = config.sigma_px > 0.0;
  for (int round = 0; round < 2 && adjustment.has_value; ++round) {
    const BundleSolution& so_far = adjustment.solution;
    constexpr double min_sigma = 2e-5;  // about 0.01 px: no tracker is better, and rates are sampled
    const double robust = robust_sigma(so_far.residual_px, so_far.dof);
    const double given = std::max(round == 0 ? robust : sigma_by_squares(so_far), min_sigma);
    if (!sigma_is_known) solve.sigma_px = given;
    if (config.reject && round == 0) {
      adjustment.num_rejected = reject_far(bundle, so_far, std::max(given, solve.sigma_px));
    }
    bundle.camera = so_far.camera;
    bundle.points = so_far.points;
    BundleSolution again = solve_rotation_bundle(
        bundle, config.prior ? config.prior->about(so_far.camera) : CommonPrior(so_far.camera), solve, progress);
    adjustment.has_value = again.converged && std::isfinite(again.rms_px);
    adjustment.solution = std::move(again);
  }
}

}  // namespace

Adjustment adjust(const FrameBuffer& buffer, const AdjustConfig& config, const Progress& progress) {
  Adjustment adjustment;
  adjustment.bundle = bundle_of(buffer, config, adjustment.bundle_point_of);
  RotationBundle& bundle = adjustment.bundle;
  const std::size_t unknowns = static_cast<std::size_t>(CommonLayout(config.nuisances).size) + 2 * bundle.points.size();
  if (2 * bundle.observations.size() < unknowns + 4) return adjustment;

  RotationBundleConfig solve;
  solve.nuisances = config.nuisances;
  solve.with_depth = config.with_depth;
  solve.gives_up = config.gives_up;
  solve.sigma_rotation_rad = config.sigma_rotation_rad;
  solve.sigma_rate_rad_per_s = config.sigma_rate_rad_per_s;
  solve.sigma_range_m = config.sigma_range_m > 0.0 ? config.sigma_range_m : 1e-3;
  const bool sigma_is_known = config.sigma_px > 0.0;
  solve.sigma_px = sigma_is_known ? config.sigma_px : 2e-3;
  const auto attempt = [&](const RotatingCamera& start) {
    if (!start_points(bundle, start, config.with_depth)) return;
    bundle.camera = start;
    BundleSolution solution =
        solve_rotation_bundle(bundle, config.prior ? config.prior->about(start) : CommonPrior(start), solve, progress);
    const bool is_better = !adjustment.has_value || solution.sum_squares < adjustment.solution.sum_squares;
    if (!std::isfinite(solution.rms_px) || !is_better) return;
    if (!solution.converged && !most_fit(solution, solve.sigma_px)) return;
    adjustment.solution = std::move(solution);
    adjustment.has_value = true;
  };
  const int max_iterations = std::exchange(solve.max_iterations, config.max_iterations);
  attempt(config.start);
  for (const double focal : config.other_starts) attempt(with_focal(config.start, focal));

  solve.max_iterations = max_iterations;
  solve_again(config, progress, solve, adjustment);
  adjustment.sigma_px = solve.sigma_px;
  return adjustment;
}

}  // namespace alidade
