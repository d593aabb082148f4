#include "alidade/observe/solve/rotation_bundle.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "alidade/estimation/median.h"
#include "alidade/geometry/so3.h"
#include "alidade/observe/solve/bundle_normal.h"
#include "alidade/observe/solve/gram_sum.h"

namespace alidade {
namespace {

constexpr double inverse_depth_information = 1.0;  // a point is about 1 m away or farther: σ = 1/m

/// Everything that is estimated in a bundle.
struct AdjustedState {
  RotatingCamera camera;
  std::vector<BearingPoint> points;
  std::vector<Eigen::Vector3d> rotation_errors;  ///< One per frame, or none.
};

class Solver {
 public:
  Solver(const RotationBundle& bundle, const CommonPrior& prior, const RotationBundleConfig& config)
      : bundle_(bundle), prior_(prior), config_(config), layout_(without_rotation(config.nuisances)) {
    num_rotations_ = config.nuisances.rotation ? static_cast<int>(bundle.frames.size()) : 0;
    state_ = {bundle.camera, bundle.points,
              std::vector<Eigen::Vector3d>(bundle.frames.size(), Eigen::Vector3d::Zero())};
    normal_.points.resize(bundle.points.size());
    normal_.frames.resize(static_cast<std::size_t>(num_rotations_));
    normal_.frames_are_measured = !is_random_walk() && std::isfinite(config.sigma_rotation_rad);
  }

  BundleSolution solve(const Progress& progress) {
    BundleSolution solution;
    double cost = cost_at(state_);
    double damping = 1e-4;
    int num_settled = 0;
    std::vector<double> gains;
    for (int i = 0; i < config_.max_iterations && std::isfinite(cost); ++i) {
      report_progress(progress, "adjust", static_cast<std::size_t>(i),
                      static_cast<std::size_t>(config_.max_iterations));
      linearise();
      solution.iterations = i + 1;
      bool moved = false;
      double next_cost = cost;
      for (int attempt = 0; attempt < 12 && !moved; ++attempt) {
        const AdjustedState next = stepped(damping);
        next_cost = cost_at(next);
        moved = next_cost <= cost;
        if (moved) state_ = next;
        damping = moved ? std::max(damping * 0.1, 1e-12) : damping * 10.0;
      }
      // The cost does not decrease any more: a minimum up to rounding, or a hardly
      // determined point that moves on along its Huber cost without any effect on the rest.
      constexpr double hardly = 1e-3;  // of χ²: 0.03σ
      constexpr int enough = 3;        // times in a row
      const double gain = cost - next_cost;
      num_settled = gain < hardly ? num_settled + 1 : 0;
      if (!moved || gain < 1e-9 * (1.0 + cost) || num_settled == enough) {
        solution.converged = true;
        if (moved) cost = next_cost;
        break;
      }
      cost = next_cost;
      gains.push_back(gain);
      if (is_hopeless(gains, cost)) break;
    }
    linearise();
    conclude(solution);
    return solution;
  }

 private:
  /// Whether steps whose gains decrease at the present rate would not converge within
  /// the remaining iterations, while most residuals are still far above the noise.
  [[nodiscard]] bool is_hopeless(const std::vector<double>& gains, double cost) const {
    constexpr std::size_t enough = 20, over = 5;
    constexpr double settled = 1e-3, by_far = 1.5, far_off = 5.0;
    if (!config_.gives_up || gains.size() < enough) return false;
    const auto last = std::span(gains).last(over + 1);
    const double log_rate = std::log(last.back() / last.front()) / static_cast<double>(over);
    const double target = std::max(settled, 1e-9 * (1.0 + cost));
    const double needed =
        log_rate < 0.0 ? std::log(target / last.back()) / log_rate : std::numeric_limits<double>::infinity();
    const auto left = static_cast<double>(config_.max_iterations) - static_cast<double>(gains.size());
    return needed > by_far * std::max(left, 1.0) &&
           median_of(residual_px_) > far_off * rayleigh_median * config_.sigma_px;
  }

  static ObserveNuisances without_rotation(ObserveNuisances nuisances) {
    nuisances.rotation = false;
    return nuisances;
  }

  [[nodiscard]] RotationFrame frame_at(const AdjustedState& state, int frame) const {
    RotationFrame rotated = bundle_.frames[static_cast<std::size_t>(frame)];
    if (num_rotations_ > 0) {
      rotated.cam_from_start = exp_so3(state.rotation_errors[static_cast<std::size_t>(frame)]) * rotated.cam_from_start;
    }
    return rotated;
  }

  [[nodiscard]] double huber_cost(double norm) const {
    const double k = config_.huber;
    return k > 0.0 && norm > k ? k * (2.0 * norm - k) : norm * norm;
  }
  [[nodiscard]] double huber_weight(double norm) const {
    const double k = config_.huber;
    return k > 0.0 && norm > k ? k / norm : 1.0;
  }

  /// Twice the negative log-likelihood; infinite if a point has no pixel.
  [[nodiscard]] double cost_at(const AdjustedState& state) const {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    if (!(state.camera.k[0] > 0.02 && state.camera.k[1] > 0.02)) return infinity;
    const CommonVector offset = prior_.offset(layout_, state.camera);
    double cost = offset.dot(prior_.information(layout_) * offset);
    std::optional<RotationView> view;
    int frame = -1;
    for (const BundleObservation& seen : bundle_.observations) {
      if (seen.frame != frame) view.emplace(state.camera, frame_at(state, frame = seen.frame));
      const auto px = view->project(state.points[static_cast<std::size_t>(seen.point)]);
      if (!px) return infinity;
      cost += huber_cost((*px - seen.px).norm() / config_.sigma_px);
    }
    for (const BundleRange& range : bundle_.ranges) {
      const double residual = range_residual(state, range);
      if (!std::isfinite(residual)) return infinity;
      cost += huber_cost(std::abs(residual));
    }
    if (config_.with_depth) {
      for (std::size_t i = 0; i < state.points.size(); ++i) {
        const double change = state.points[i].inverse_depth - bundle_.points[i].inverse_depth;
        cost += inverse_depth_information * change * change;
      }
    }
    for (int k = 0; k < num_rotations_; ++k) {
      cost += rotation_information(k) *
              (rotation_error(state, k) - (is_random_walk() ? rotation_error(state, k - 1) : Eigen::Vector3d::Zero()))
                  .squaredNorm();
    }
    return cost;
  }

  [[nodiscard]] bool is_random_walk() const { return config_.sigma_rate_rad_per_s > 0.0; }
  [[nodiscard]] static Eigen::Vector3d rotation_error(const AdjustedState& state, int k) {
    return k < 0 ? Eigen::Vector3d::Zero() : state.rotation_errors[static_cast<std::size_t>(k)];
  }
  /// 1/σ² of a rotation, or of its step from the frame before. For unmeasured rotations
  /// or a random walk the first frame is fixed (gauge freedom of the world orientation).
  [[nodiscard]] double rotation_information(int k) const {
    constexpr double fixed = 1e12;
    if (!is_random_walk())
      return std::isfinite(config_.sigma_rotation_rad) ? 1.0 / square(config_.sigma_rotation_rad)
                                                       : (k == 0 ? fixed : 0.0);
    const auto i = static_cast<std::size_t>(k);
    if (k == 0) return fixed;
    const double elapsed_s = bundle_.frames[i].t_s - bundle_.frames[i - 1].t_s;
    return 1.0 / std::max(square(config_.sigma_rate_rad_per_s) * bundle_.frames[i].dt_s * elapsed_s, 1.0 / fixed);
  }

  [[nodiscard]] static double square(double x) { return x * x; }

  [[nodiscard]] double range_residual(const AdjustedState& state, const BundleRange& range) const {
    const BearingPoint& point = state.points[static_cast<std::size_t>(range.point)];
    if (!(point.inverse_depth > 0.0)) return std::numeric_limits<double>::infinity();
    const RotationFrame frame = frame_at(state, range.frame);
    const double distance_m = RotationView(state.camera, frame).point_in_cam(point).norm() / point.inverse_depth;
    return (distance_m - range.range_m) / config_.sigma_range_m;
  }

  /// Normal equations at the current state, including the prior.
  void linearise() {
    const int n = layout_.size;
    normal_.common = prior_.information(layout_);
    normal_.gradient = prior_.information(layout_) * prior_.offset(layout_, state_.camera);
    for (std::size_t i = 0; i < normal_.points.size(); ++i) begin_point(i);
    for (NormalBlock& frame : normal_.frames) {
      frame.information.setZero();
      frame.gradient.setZero();
      frame.by_common.setZero(3, n);
    }
    normal_.crossings.clear();
    normal_.walk.clear();
    residual_px_.clear();
    residuals_.clear();
    sum_squares_ = 0.0;
    for (int k = 0; k < num_rotations_; ++k) add_rotation_prior(k);
    std::optional<RotationView> view;
    int frame = -1;
    for (const BundleObservation& seen : bundle_.observations) {
      if (seen.frame != frame) view.emplace(state_.camera, frame_at(state_, frame = seen.frame));
      add_observation(*view, seen);
    }
    gram_.flush();
    normal_.common.triangularView<Eigen::StrictlyUpper>() = normal_.common.transpose();
    for (const BundleRange& range : bundle_.ranges) add_range(range);
  }

  void begin_point(std::size_t i) {
    NormalBlock& block = normal_.points[i];
    block.information.setZero();
    block.gradient.setZero();
    block.by_common.setZero(3, layout_.size);
    if (config_.with_depth) {
      block.information(2, 2) = inverse_depth_information;
      block.gradient[2] =
          inverse_depth_information * (state_.points[i].inverse_depth - bundle_.points[i].inverse_depth);
    } else {
      block.information(2, 2) = 1.0;  // without any coupling: the step is zero
    }
  }

  void add_rotation_prior(int k) {
    const double information = rotation_information(k);
    NormalBlock& frame = normal_.frames[static_cast<std::size_t>(k)];
    const Eigen::Vector3d before = is_random_walk() ? rotation_error(state_, k - 1) : Eigen::Vector3d::Zero();
    const Eigen::Vector3d pull = information * (rotation_error(state_, k) - before);
    frame.information.diagonal().array() += information;
    frame.gradient += pull;
    if (!is_random_walk()) return;
    normal_.walk.push_back(information);
    if (k == 0) return;
    NormalBlock& last = normal_.frames[static_cast<std::size_t>(k - 1)];
    last.information.diagonal().array() += information;
    last.gradient -= pull;
  }

  void add_observation(const RotationView& view, const BundleObservation& seen) {
    RotationPrediction& p = prediction_;
    const BearingPoint& point = state_.points[static_cast<std::size_t>(seen.point)];
    if (!view.predict(point, num_rotations_ > 0 ? rotation_layout_ : layout_, p)) {
      residual_px_.push_back(std::numeric_limits<double>::infinity());
      residuals_.push_back(Eigen::Vector2d::Constant(not_seen));
      return;
    }
    const Eigen::Vector2d error = p.px - seen.px;
    residual_px_.push_back(error.norm());
    residuals_.push_back(error);
    const double weight = huber_weight(error.norm() / config_.sigma_px) / square(config_.sigma_px);
    sum_squares_ += weight * error.squaredNorm();
    const PixelByCommon by_common = p.J_px_common.leftCols(layout_.size);
    if (!config_.with_depth) p.J_px_point.col(2).setZero();
    NormalBlock& block = normal_.points[static_cast<std::size_t>(seen.point)];
    gram_.add(by_common, weight, normal_.common);
    normal_.gradient.noalias() += by_common.transpose() * (weight * error);
    block.information.noalias() += weight * p.J_px_point.transpose() * p.J_px_point;
    block.gradient.noalias() += weight * p.J_px_point.transpose() * error;
    block.by_common.noalias() += weight * p.J_px_point.transpose() * by_common;
    if (num_rotations_ > 0)
      add_rotation(seen, p.J_px_common.middleCols<3>(rotation_layout_.rotation), by_common, error, weight);
  }

  void add_rotation(const BundleObservation& seen, const Eigen::Matrix<double, 2, 3>& by_rotation,
                    const PixelByCommon& by_common, const Eigen::Vector2d& error, double weight) {
    NormalBlock& frame = normal_.frames[static_cast<std::size_t>(seen.frame)];
    frame.information.noalias() += weight * by_rotation.transpose() * by_rotation;
    frame.by_common.noalias() += weight * by_rotation.transpose() * by_common;
    frame.gradient.noalias() += weight * by_rotation.transpose() * error;
    normal_.crossings.push_back({seen.point, seen.frame, weight * prediction_.J_px_point.transpose() * by_rotation});
  }

  void add_range(const BundleRange& range) {
    const double residual = range_residual(state_, range);
    const BearingPoint& point = state_.points[static_cast<std::size_t>(range.point)];
    const RotationFrame frame = frame_at(state_, range.frame);
    const RotationView view(state_.camera, frame);
    const Eigen::Vector3d d = view.point_in_cam(point);
    PointByCommonSlope J_common(3, layout_.size);
    Eigen::Matrix3d J_point;
    view.point_jacobians(point, layout_, J_common, J_point);
    const double chi = point.inverse_depth;
    const Eigen::RowVector3d J_d = d.transpose() / (d.norm() * chi * config_.sigma_range_m);
    const CommonVector by_common = (J_d * J_common).transpose();
    Eigen::Vector3d by_point = (J_d * J_point).transpose();
    by_point[2] -= d.norm() / (chi * chi * config_.sigma_range_m);
    const double weight = huber_weight(std::abs(residual));
    NormalBlock& block = normal_.points[static_cast<std::size_t>(range.point)];
    normal_.common.noalias() += weight * by_common * by_common.transpose();
    normal_.gradient.noalias() += weight * residual * by_common;
    block.information.noalias() += weight * by_point * by_point.transpose();
    block.gradient.noalias() += weight * residual * by_point;
    block.by_common.noalias() += weight * by_point * by_common.transpose();
    sum_squares_ += weight * residual * residual;
  }

  [[nodiscard]] AdjustedState stepped(double damping) const {
    const BundleStep step = bundle_step(normal_, damping);
    AdjustedState next = state_;
    if (!step.common.allFinite()) return next;
    next.camera = state_.camera.retract(layout_, CommonVector(step.common));
    for (std::size_t k = 0; k < step.frames.size(); ++k) {
      Eigen::Vector3d& at = next.rotation_errors[k];
      at = log_so3((exp_so3(step.frames[k]) * exp_so3(at)).normalized());
    }
    for (std::size_t i = 0; i < step.points.size(); ++i) {
      next.points[i].ab += step.points[i].head<2>();
      if (config_.with_depth) next.points[i].inverse_depth += step.points[i].z();
    }
    return next;
  }

  void conclude(BundleSolution& solution) {
    const int n = layout_.size;
    solution.camera = state_.camera;
    solution.points = state_.points;
    for (int k = 0; k < static_cast<int>(bundle_.frames.size()); ++k) {
      solution.mount_from_start.push_back(frame_at(state_, k).cam_from_start);
    }
    solution.prior_information = prior_.information(layout_);
    solution.prior_gradient = solution.prior_information * prior_.offset(layout_, state_.camera);
    solution.given_information = prior_.given_information(layout_);
    solution.information = common_information(normal_, solution.prior_information);
    for (std::size_t i = 0; i < normal_.points.size() && num_rotations_ == 0; ++i) {
      const Eigen::Matrix3d inverse = inverse_of_point(normal_.points[i], 0.0);
      solution.given_common.push_back({-inverse * normal_.points[i].by_common, inverse});
    }
    if (num_rotations_ > 0) solution.rotation_errors = state_.rotation_errors;
    solution.rotations_walk = is_random_walk();
    for (int k = 0; k < num_rotations_; ++k) {
      const double known = rotation_information(k);
      solution.rotation_information.push_back(known);
      const double all = normal_.frames[static_cast<std::size_t>(k)].information.trace() / 3.0;
      solution.rotation_information_seen.push_back(std::max(all - known, 0.0));
    }
    solution.residual_px = residual_px_;
    solution.residuals = residuals_;
    solution.sum_squares = sum_squares_;
    double squares = 0.0;
    for (const double norm : residual_px_) squares += norm * norm;
    const auto count = 2.0 * static_cast<double>(std::max<std::size_t>(residual_px_.size(), 1));
    solution.rms_px = std::sqrt(squares / count);
    const auto is_seen_at_all = [](const NormalBlock& block) { return block.information(0, 0) > 0.0; };
    const auto num_points =
        static_cast<int>(std::count_if(normal_.points.begin(), normal_.points.end(), is_seen_at_all));
    const int unknowns = n + (config_.with_depth ? 3 : 2) * num_points +
                         (num_rotations_ > 0 && !is_random_walk() && !std::isfinite(config_.sigma_rotation_rad)
                              ? 3 * (num_rotations_ - 1)
                              : 0);
    solution.dof = static_cast<int>(2 * bundle_.observations.size() + bundle_.ranges.size()) - unknowns;
  }

  const RotationBundle& bundle_;
  const CommonPrior& prior_;
  const RotationBundleConfig& config_;
  const CommonLayout layout_;
  const CommonLayout rotation_layout_{with_turn(config_.nuisances)};
  int num_rotations_ = 0;  ///< Number of frames with an estimated rotation.
  AdjustedState state_;
  BundleNormal normal_;
  std::vector<double> residual_px_;
  std::vector<Eigen::Vector2d> residuals_;
  double sum_squares_ = 0.0;
  RotationPrediction prediction_;
  GramSum gram_;

  static ObserveNuisances with_turn(ObserveNuisances nuisances) {
    nuisances.rotation = true;
    return nuisances;
  }
};

}  // namespace

BundleSolution solve_rotation_bundle(const RotationBundle& bundle, const CommonPrior& prior,
                                     const RotationBundleConfig& config, const Progress& progress) {
  return Solver(bundle, prior, config).solve(progress);
}

}  // namespace alidade
