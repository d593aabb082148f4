#include "alidade/turned/turned_bundle.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/so3.h"

namespace alidade {
namespace {

constexpr double fixed = 1e12;    // information of parameters that are not estimated
constexpr double outside = 30.0;  // residual [σ] assigned to a point without a pixel

using ByCamera = Eigen::Matrix<double, 2, num_camera>;
using ByPhoto = Eigen::Matrix<double, 2, per_photo>;

/// Block of a track in the normal equations: its ray (two directions across it), and its coupling to the rest.
struct TrackBlock {
  std::size_t first = 0, last = 0;  ///< Range of its observations.
  Eigen::Matrix<double, 3, 2> across;
  Eigen::Matrix2d information, inverse;
  Eigen::Vector2d gradient;
  ByCamera by_camera;
};

double huber_cost(double norm, double k) { return norm > k ? k * (2.0 * norm - k) : norm * norm; }
double huber_weight(double norm, double k) { return norm > k ? k / norm : 1.0; }

Eigen::Index place_of(int photo) { return num_camera + per_photo * static_cast<Eigen::Index>(photo); }

class TurnedSystem {
 public:
  TurnedSystem(const TurnedBundle& bundle, const TurnedPrior& prior, const TurnedSolveConfig& config, int without)
      : bundle_(bundle), prior_(prior), config_(config), without_(without) {
    const auto size = place_of(static_cast<int>(bundle.cam_from_world.size()));
    information_.setZero(size, size);
    gradient_.setZero(size);
    information_.topLeftCorner<num_camera, num_camera>() = prior.information;
    gradient_.head<num_camera>() = prior.information * (bundle.camera - prior.mean);
    for (std::size_t k = 0; k < bundle.cam_from_world.size(); ++k) {
      const auto at = place_of(static_cast<int>(k));
      const bool is_fixed = k == 0 || static_cast<int>(k) == without;
      information_.diagonal().segment<3>(at).array() += is_fixed ? fixed : 0.0;
      const double zoom = is_fixed ? fixed : prior.zoom_information;
      information_(at + 3, at + 3) += zoom;
      if (!is_fixed && zoom < fixed) gradient_[at + 3] += zoom * bundle.log_zoom[k];
    }
    by_photo_.resize(bundle.observations.size());
    for (std::size_t i = 0; i < bundle.observations.size();) {
      std::size_t end = i;
      while (end < bundle.observations.size() && bundle.observations[end].track == bundle.observations[i].track) ++end;
      add_track(i, end);
      i = end;
    }
  }

  /// The reduced normal equations, with the diagonals multiplied by 1 + `damping`.
  [[nodiscard]] TurnedNormal reduced(double damping) {
    TurnedNormal normal{information_, gradient_};
    normal.information.diagonal() *= 1.0 + damping;
    for (TrackBlock& block : blocks_) eliminate(block, damping, normal);
    normal.information.triangularView<Eigen::StrictlyUpper>() = normal.information.transpose();
    if (!(prior_.zoom_information < fixed)) hold_zooms(normal);
    return normal;
  }

  /// The bundle after a step; to be called after reduced().
  [[nodiscard]] TurnedBundle moved(const Eigen::VectorXd& step) const {
    TurnedBundle next = bundle_;
    next.camera += step.head<num_camera>();
    for (std::size_t k = 0; k < next.cam_from_world.size(); ++k) {
      const auto at = place_of(static_cast<int>(k));
      next.cam_from_world[k] = exp_so3(step.segment<3>(at)).normalized().toRotationMatrix() * next.cam_from_world[k];
      next.log_zoom[k] += step[at + 3];
    }
    for (const TrackBlock& block : blocks_) {
      Eigen::Vector2d right = block.gradient + block.by_camera * step.head<num_camera>();
      for (std::size_t i = block.first; i < block.last; ++i) {
        right += by_photo_[i] * step.segment<per_photo>(place_of(bundle_.observations[i].photo));
      }
      Eigen::Vector3d& ray = next.rays[static_cast<std::size_t>(bundle_.observations[block.first].track)];
      ray = (ray - block.across * (block.inverse * right)).normalized();
    }
    return next;
  }

 private:
  /// Fixes zooms that are not estimated exactly: many precise pixels have nearly
  /// as much information on them as `fixed`, and would move them step by step.
  void hold_zooms(TurnedNormal& normal) const {
    for (std::size_t k = 0; k < bundle_.cam_from_world.size(); ++k) {
      const auto at = place_of(static_cast<int>(k)) + 3;
      normal.information.row(at).setZero();
      normal.information.col(at).setZero();
      normal.information(at, at) = fixed;
      normal.gradient[at] = 0.0;
    }
  }

  void add_track(std::size_t first, std::size_t last) {
    TrackBlock block{first, last, {}, {}, {}, {}, {}};
    const Eigen::Vector3d& ray = bundle_.rays[static_cast<std::size_t>(bundle_.observations[first].track)];
    block.across = two_across(ray);
    block.information.setZero();
    block.gradient.setZero();
    block.by_camera.setZero();
    for (std::size_t i = first; i < last; ++i) add_observation(i, ray, block);
    block.information.diagonal().array() += 1e-9;  // keeps an unobserved point where it is
    blocks_.push_back(block);
  }

  void add_observation(std::size_t i, const Eigen::Vector3d& ray, TrackBlock& block) {
    const TurnedDetection& observation = bundle_.observations[i];
    by_photo_[i].setZero();
    if (observation.photo == without_) return;
    const auto photo = static_cast<std::size_t>(observation.photo);
    TurnedPrediction seen;
    if (!predict_turned(bundle_.camera, bundle_.cam_from_world[photo], bundle_.log_zoom[photo], ray, seen)) return;
    const Eigen::Vector2d residual = seen.px - observation.px;
    const double weight =
        huber_weight(residual.norm() / config_.sigma_px, config_.huber) / (config_.sigma_px * config_.sigma_px);
    const auto at = place_of(observation.photo);
    const ByCamera c = weight * seen.J_camera;
    const ByPhoto p = weight * seen.J_photo;
    information_.topLeftCorner<num_camera, num_camera>().noalias() += seen.J_camera.transpose() * c;
    information_.block<per_photo, num_camera>(at, 0).noalias() += seen.J_photo.transpose() * c;
    information_.block<per_photo, per_photo>(at, at).noalias() += seen.J_photo.transpose() * p;
    gradient_.head<num_camera>().noalias() += c.transpose() * residual;
    gradient_.segment<per_photo>(at).noalias() += p.transpose() * residual;
    const Eigen::Matrix2d J = seen.J_ray * block.across;
    block.information.noalias() += weight * J.transpose() * J;
    block.gradient.noalias() += weight * J.transpose() * residual;
    block.by_camera.noalias() += J.transpose() * c;
    by_photo_[i].noalias() = J.transpose() * p;
  }

  void eliminate(TrackBlock& block, double damping, TurnedNormal& normal) const {
    Eigen::Matrix2d information = block.information;
    information.diagonal() *= 1.0 + damping;
    block.inverse = information.inverse();
    const Eigen::Vector2d gain = block.inverse * block.gradient;
    const ByCamera camera_gain = block.inverse * block.by_camera;
    normal.information.topLeftCorner<num_camera, num_camera>().noalias() -= block.by_camera.transpose() * camera_gain;
    normal.gradient.head<num_camera>().noalias() -= block.by_camera.transpose() * gain;
    for (std::size_t i = block.first; i < block.last; ++i) {
      const auto at = place_of(bundle_.observations[i].photo);
      normal.gradient.segment<per_photo>(at).noalias() -= by_photo_[i].transpose() * gain;
      normal.information.block<per_photo, num_camera>(at, 0).noalias() -= by_photo_[i].transpose() * camera_gain;
      const ByPhoto photo_gain = block.inverse * by_photo_[i];
      for (std::size_t j = block.first; j < block.last; ++j) {
        const auto row = place_of(bundle_.observations[j].photo);
        if (row < at) continue;
        normal.information.block<per_photo, per_photo>(row, at).noalias() -= by_photo_[j].transpose() * photo_gain;
      }
    }
  }

  const TurnedBundle& bundle_;
  const TurnedPrior& prior_;
  const TurnedSolveConfig& config_;
  int without_;
  Eigen::MatrixXd information_;
  Eigen::VectorXd gradient_;
  std::vector<TrackBlock> blocks_;
  std::vector<ByPhoto> by_photo_;  ///< Derivative of an observation's ray by the parameters of its photo.
};

/// Twice the negative log-likelihood with Huber's cost; a point without a pixel counts as `outside`.
double cost_of(const TurnedBundle& bundle, const TurnedPrior& prior, const TurnedSolveConfig& config) {
  constexpr double min_focal = 0.05;
  if (!(bundle.camera.head<2>().minCoeff() > min_focal)) return std::numeric_limits<double>::infinity();
  const TurnedCamera offset = bundle.camera - prior.mean;
  double cost = offset.dot(prior.information * offset);
  for (const double zoom : bundle.log_zoom)
    cost += prior.zoom_information < fixed ? prior.zoom_information * zoom * zoom : 0.0;
  for (const TurnedDetection& observation : bundle.observations) {
    const auto photo = static_cast<std::size_t>(observation.photo);
    const auto px = turned_pixel(bundle.camera, bundle.cam_from_world[photo], bundle.log_zoom[photo],
                                 bundle.rays[static_cast<std::size_t>(observation.track)]);
    cost += huber_cost(px ? std::min((*px - observation.px).norm() / config.sigma_px, 1e6) : outside, config.huber);
  }
  return cost;
}

}  // namespace

TurnedNormal turned_normal(const TurnedBundle& bundle, const TurnedPrior& prior, const TurnedSolveConfig& config,
                           int without_photo) {
  return TurnedSystem(bundle, prior, config, without_photo).reduced(0.0);
}

TurnedSolution solve_turned(TurnedBundle& bundle, const TurnedPrior& prior, const TurnedSolveConfig& config,
                            const Progress& progress) {
  TurnedSolution solution;
  solution.cost = cost_of(bundle, prior, config);
  double damping = 1e-4;
  for (int i = 0; i < config.max_iterations && std::isfinite(solution.cost) && !solution.converged; ++i) {
    report_progress(progress, "adjust", static_cast<std::size_t>(i), static_cast<std::size_t>(config.max_iterations));
    solution.iterations = i + 1;
    TurnedSystem system(bundle, prior, config, -1);
    bool is_lower = false;
    for (int attempt = 0; attempt < 10 && !is_lower; ++attempt) {
      const TurnedNormal normal = system.reduced(damping);
      const Eigen::VectorXd step = -solve_symmetric(normal.information, normal.gradient);
      damping = std::min(damping * 10.0, 1e8);
      if (!step.allFinite()) continue;
      TurnedBundle next = system.moved(step);
      const double cost = cost_of(next, prior, config);
      is_lower = cost <= solution.cost;
      if (!is_lower) continue;
      damping = std::max(damping * 1e-2, 1e-12);
      solution.converged = solution.cost - cost < config.min_gain * (1.0 + cost);
      solution.cost = cost;
      bundle = std::move(next);
    }
    if (!is_lower) solution.converged = true;  // a minimum, up to rounding
  }
  solution.residuals.reserve(bundle.observations.size());
  for (const TurnedDetection& observation : bundle.observations) {
    const auto photo = static_cast<std::size_t>(observation.photo);
    const auto px = turned_pixel(bundle.camera, bundle.cam_from_world[photo], bundle.log_zoom[photo],
                                 bundle.rays[static_cast<std::size_t>(observation.track)]);
    solution.residuals.push_back(
        px ? Eigen::Vector2d(*px - observation.px)
           : Eigen::Vector2d(Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN())));
  }
  return solution;
}

std::vector<double> freed_norms(const TurnedBundle& bundle, const std::vector<Eigen::Vector2d>& residuals) {
  std::vector<double> seen(bundle.rays.size(), 0.0), norms;
  for (const TurnedDetection& observation : bundle.observations)
    seen[static_cast<std::size_t>(observation.track)] += 1.0;
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    const double m = std::max(seen[static_cast<std::size_t>(bundle.observations[i].track)], 2.0);
    norms.push_back(residuals[i].norm() / std::sqrt(1.0 - 1.0 / m));
  }
  return norms;
}

}  // namespace alidade
