#include "alidade/observe/solve/rotation_bundle.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/so3.h"

namespace alidade {
namespace {

constexpr double inverse_depth_information = 1.0;  // a point is 1 m away or farther: σ 1/m

using PointByCommon = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, max_common>;

/// The state of a bundle in its search: everything that is estimated.
struct AdjustedState {
  RotatingCamera camera;
  std::vector<BearingPoint> points;
  std::vector<Eigen::Vector3d> rotation_errors;  ///< One per frame, or none.
};

struct PointFrameBlock {
  int frame = 0;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  ///< point × rotation error
};

struct PointBlock {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  PointByCommon by_common;
  std::vector<PointFrameBlock> by_frame;
};

class Solver {
 public:
  Solver(const RotationBundle& bundle, const CommonPrior& prior, const RotationBundleConfig& config)
      : bundle_(bundle), prior_(prior), config_(config), layout_(without_rotation(config.nuisances)) {
    num_rotations_ = config.nuisances.rotation ? static_cast<int>(bundle.frames.size()) : 0;
    state_ = {bundle.camera, bundle.points,
              std::vector<Eigen::Vector3d>(bundle.frames.size(), Eigen::Vector3d::Zero())};
    blocks_.resize(bundle.points.size());
  }

  BundleSolution solve(const Progress& progress) {
    BundleSolution solution;
    double cost = cost_at(state_);
    double damping = 1e-4;
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
      // Nothing lowers the cost any more: the bottom, but for rounding.
      const double gain = cost - next_cost;
      if (!moved || gain < 1e-9 * (1.0 + cost)) {
        solution.converged = true;
        if (moved) cost = next_cost;
        break;
      }
      cost = next_cost;
    }
    linearise();
    conclude(solution);
    return solution;
  }

 private:
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

  /// Twice the negative log-likelihood; infinite where a point has no pixel.
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
  /// 1/σ² of a rotation, or of its step from the frame before. The first frame of rotations that are not measured, or
  /// walk, is fixed: the world's orientation is free.
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

  /// Normal equations at that state, prior included.
  void linearise() {
    const int n = layout_.size;
    common_.setZero(n + 3 * num_rotations_, n + 3 * num_rotations_);
    gradient_.setZero(n + 3 * num_rotations_);
    common_.topLeftCorner(n, n) = prior_.information(layout_);
    gradient_.head(n) = prior_.information(layout_) * prior_.offset(layout_, state_.camera);
    for (std::size_t i = 0; i < blocks_.size(); ++i) begin_point(i);
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
    for (const BundleRange& range : bundle_.ranges) add_range(range);
  }

  void begin_point(std::size_t i) {
    PointBlock& block = blocks_[i];
    block.information.setZero();
    block.gradient.setZero();
    block.by_common.setZero(3, layout_.size);
    block.by_frame.clear();
    if (config_.with_depth) {
      block.information(2, 2) = inverse_depth_information;
      block.gradient[2] =
          inverse_depth_information * (state_.points[i].inverse_depth - bundle_.points[i].inverse_depth);
    } else {
      block.information(2, 2) = 1.0;  // nothing else touches it: the step is zero
    }
  }

  void add_rotation_prior(int k) {
    const double information = rotation_information(k);
    const int at = layout_.size + 3 * k;
    common_.diagonal().segment<3>(at).array() += information;
    const Eigen::Vector3d before = is_random_walk() ? rotation_error(state_, k - 1) : Eigen::Vector3d::Zero();
    const Eigen::Vector3d pull = information * (rotation_error(state_, k) - before);
    gradient_.segment<3>(at) += pull;
    if (!is_random_walk() || k == 0) return;
    common_.diagonal().segment<3>(at - 3).array() += information;
    common_.block<3, 3>(at, at - 3).diagonal().array() -= information;
    common_.block<3, 3>(at - 3, at).diagonal().array() -= information;
    gradient_.segment<3>(at - 3) -= pull;
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
    const int n = layout_.size;
    const PixelByCommon by_common = p.J_px_common.leftCols(n);
    if (!config_.with_depth) p.J_px_point.col(2).setZero();
    PointBlock& block = blocks_[static_cast<std::size_t>(seen.point)];
    common_.topLeftCorner(n, n).noalias() += weight * by_common.transpose() * by_common;
    gradient_.head(n).noalias() += weight * by_common.transpose() * error;
    block.information.noalias() += weight * p.J_px_point.transpose() * p.J_px_point;
    block.gradient.noalias() += weight * p.J_px_point.transpose() * error;
    block.by_common.noalias() += weight * p.J_px_point.transpose() * by_common;
    if (num_rotations_ > 0)
      add_rotation(seen, p.J_px_common.middleCols<3>(rotation_layout_.rotation), by_common, error, weight, block);
  }

  void add_rotation(const BundleObservation& seen, const Eigen::Matrix<double, 2, 3>& by_rotation,
                    const PixelByCommon& by_common, const Eigen::Vector2d& error, double weight, PointBlock& block) {
    const int at = layout_.size + 3 * seen.frame;
    common_.block<3, 3>(at, at).noalias() += weight * by_rotation.transpose() * by_rotation;
    common_.block(0, at, layout_.size, 3).noalias() += weight * by_common.transpose() * by_rotation;
    common_.block(at, 0, 3, layout_.size) = common_.block(0, at, layout_.size, 3).transpose();
    gradient_.segment<3>(at).noalias() += weight * by_rotation.transpose() * error;
    PointFrameBlock by_frame{seen.frame};
    by_frame.information.noalias() = weight * prediction_.J_px_point.transpose() * by_rotation;
    block.by_frame.push_back(by_frame);
  }

  void add_range(const BundleRange& range) {
    const double residual = range_residual(state_, range);
    const BearingPoint& point = state_.points[static_cast<std::size_t>(range.point)];
    const RotationFrame frame = frame_at(state_, range.frame);
    const RotationView view(state_.camera, frame);
    const Eigen::Vector3d d = view.point_in_cam(point);
    PointByCommon J_common(3, layout_.size);
    Eigen::Matrix3d J_point;
    view.point_jacobians(point, layout_, J_common, J_point);
    const double chi = point.inverse_depth;
    const Eigen::RowVector3d J_d = d.transpose() / (d.norm() * chi * config_.sigma_range_m);
    const CommonVector by_common = (J_d * J_common).transpose();
    Eigen::Vector3d by_point = (J_d * J_point).transpose();
    by_point[2] -= d.norm() / (chi * chi * config_.sigma_range_m);
    const double weight = huber_weight(std::abs(residual));
    const int n = layout_.size;
    PointBlock& block = blocks_[static_cast<std::size_t>(range.point)];
    common_.topLeftCorner(n, n).noalias() += weight * by_common * by_common.transpose();
    gradient_.head(n).noalias() += weight * residual * by_common;
    block.information.noalias() += weight * by_point * by_point.transpose();
    block.gradient.noalias() += weight * residual * by_point;
    block.by_common.noalias() += weight * by_point * by_common.transpose();
    sum_squares_ += weight * residual * residual;
  }

  /// Eliminates the points from `reduced` and `gradient`: S = C − Σ Bᵀ P⁻¹ B.
  void eliminate_points(double damping, Eigen::MatrixXd& reduced, Eigen::VectorXd& gradient) {
    inverse_.resize(blocks_.size());
    const int n = layout_.size;
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
      const PointBlock& block = blocks_[i];
      Eigen::Matrix3d information = block.information;
      information.diagonal() *= 1.0 + damping;
      information.diagonal().array() += 1e-9;  // a point that no observation binds stays where it is
      inverse_[i] = information.inverse();
      const PointByCommon gain = inverse_[i] * block.by_common;
      reduced.topLeftCorner(n, n).noalias() -= block.by_common.transpose() * gain;
      gradient.head(n).noalias() -= gain.transpose() * block.gradient;
      for (const PointFrameBlock& a : block.by_frame) {
        const int at = n + 3 * a.frame;
        const Eigen::Matrix3d a_gain = a.information.transpose() * inverse_[i];
        reduced.block(at, 0, 3, n).noalias() -= a_gain * block.by_common;
        gradient.segment<3>(at).noalias() -= a_gain * block.gradient;
        for (const PointFrameBlock& b : block.by_frame) {
          if (b.frame <= a.frame) reduced.block<3, 3>(at, n + 3 * b.frame).noalias() -= a_gain * b.information;
        }
      }
    }
  }

  [[nodiscard]] AdjustedState stepped(double damping) {
    Eigen::MatrixXd reduced = common_;
    Eigen::VectorXd gradient = gradient_;
    reduced.diagonal() *= 1.0 + damping;
    eliminate_points(damping, reduced, gradient);
    const Eigen::VectorXd step = -solve_symmetric(reduced, gradient);
    AdjustedState next = state_;
    const int n = layout_.size;
    if (!step.allFinite()) return next;
    next.camera = state_.camera.retract(layout_, CommonVector(step.head(n)));
    for (int k = 0; k < num_rotations_; ++k) {
      Eigen::Vector3d& at = next.rotation_errors[static_cast<std::size_t>(k)];
      at = log_so3((exp_so3(step.segment<3>(n + 3 * k)) * exp_so3(at)).normalized());
    }
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
      Eigen::Vector3d right = blocks_[i].gradient + blocks_[i].by_common * step.head(n);
      for (const PointFrameBlock& seen : blocks_[i].by_frame) {
        right += seen.information * step.segment<3>(n + 3 * seen.frame);
      }
      const Eigen::Vector3d move = -inverse_[i] * right;
      next.points[i].ab += move.head<2>();
      if (config_.with_depth) next.points[i].inverse_depth += move.z();
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
    Eigen::MatrixXd reduced = common_;
    Eigen::VectorXd gradient = gradient_;
    solution.prior_information = prior_.information(layout_);
    solution.prior_gradient = solution.prior_information * prior_.offset(layout_, state_.camera);
    solution.given_information = prior_.given_information(layout_);
    reduced.topLeftCorner(n, n) -= solution.prior_information;
    eliminate_points(0.0, reduced, gradient);
    if (num_rotations_ > 0) {
      const auto turns = reduced.bottomRightCorner(3 * num_rotations_, 3 * num_rotations_);
      const Eigen::MatrixXd by_common = reduced.bottomLeftCorner(3 * num_rotations_, n);
      reduced.topLeftCorner(n, n).noalias() -= by_common.transpose() * Ldlt(turns).solve_each(by_common);
    }
    solution.information = reduced.topLeftCorner(n, n);
    if (num_rotations_ > 0) solution.rotation_errors = state_.rotation_errors;
    solution.rotations_walk = is_random_walk();
    for (int k = 0; k < num_rotations_; ++k) solution.rotation_information.push_back(rotation_information(k));
    for (std::size_t i = 0; i < blocks_.size() && num_rotations_ == 0; ++i) {
      solution.given_common.push_back({-inverse_[i] * blocks_[i].by_common, inverse_[i]});
    }
    solution.residual_px = residual_px_;
    solution.residuals = residuals_;
    solution.sum_squares = sum_squares_;
    double squares = 0.0;
    for (const double norm : residual_px_) squares += norm * norm;
    const auto count = 2.0 * static_cast<double>(std::max<std::size_t>(residual_px_.size(), 1));
    solution.rms_px = std::sqrt(squares / count);
    const auto is_seen_at_all = [](const PointBlock& block) { return block.information(0, 0) > 0.0; };
    const auto num_points = static_cast<int>(std::count_if(blocks_.begin(), blocks_.end(), is_seen_at_all));
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
  int num_rotations_ = 0;  ///< Frames whose rotation is estimated.
  AdjustedState state_;
  Eigen::MatrixXd common_;  ///< Shared parameters, then rotations.
  Eigen::VectorXd gradient_;
  std::vector<PointBlock> blocks_;
  std::vector<Eigen::Matrix3d> inverse_;
  std::vector<double> residual_px_;
  std::vector<Eigen::Vector2d> residuals_;
  double sum_squares_ = 0.0;
  RotationPrediction prediction_;

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
